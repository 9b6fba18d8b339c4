r"""Practical identifiability of each parameter from the precision of its estimate.

All in the unit cube of the parameters' bounds. With the precision M of the estimate, calibration stages included, and
that of the bounds B = 12 I (a uniform distribution),

- the *marginal* standard deviation of a parameter is that of its estimate, all others estimated along with it, within
  their bounds (`mofit.design.bounded_estimator`);
- the *conditional* one, :math:`M_{ii}^{-1/2}`, has all others known.

==========================  ===========================================================================================
verdict                     means
==========================  ===========================================================================================
identifiable                the marginal standard deviation is at most a quarter of the value, or 5 % of the box, also
                            without the parameter's own bounds
only in a combination       not so, but the conditional one is: other parameters compensate for a change of this one
one-sided                   neither, but the data exclude one of the bounds: there is a lower or an upper limit
not identifiable            neither, and no limit either
==========================  ===========================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.design.bounded_estimator import bounded_sd
from mofit.design.criteria import scales
from mofit.parameters import ParameterSpace

IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT = "identifiable", "only in a combination", "one-sided", "not identifiable"
#: From good to bad.
VERDICTS = (IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT)

#: Precision of a parameter that is uniform over its box, and the standard deviation that goes with it.
BOX_PRECISION = 12.0
BOX_SD = BOX_PRECISION**-0.5


@dataclass(frozen=True)
class IdentifiabilitySettings:
    """Where verdicts change.

    Parameters
    ----------
    share_of_value
        Largest standard deviation of an identifiable parameter over its value: its sign and size are certain.
    share_of_box
        The same over its box, for values near zero: the tests leave a sixth of the prior's width.
    one_sided
        A bound within so many standard deviations is not excluded (95 %, one side).
    most_correlated
        Most correlated parameters that are named: more do not help to understand.
    """

    share_of_value: float = 0.25
    share_of_box: float = 0.05
    one_sided: float = 1.645
    most_correlated: int = 3


SETTINGS = IdentifiabilitySettings()


@dataclass(frozen=True)
class Identifiability:
    """Of d parameters at N samples; standard deviations in the unit cube, shapes (N, d).

    Parameters
    ----------
    sd
        Marginal: of the estimate within its bounds.
    relative_sd
        The same over the magnitude of the value (`mofit.design.criteria.scales`).
    conditional_sd
        All other parameters known.
    variance_inflation
        Variance inflation factor, (marginal / conditional)².
    covariance
        With the bounds as a prior, (N, d, d).
    verdicts
        Place of the verdict in `VERDICTS`; -1 where the simulation fails.
    """

    sd: FloatArray
    relative_sd: FloatArray
    conditional_sd: FloatArray
    variance_inflation: FloatArray
    covariance: FloatArray
    verdicts: NDArray[np.int64]

    def verdict(self, place: int) -> str:
        """The most frequent verdict on a parameter over the samples that could be simulated; the worse of a tie."""
        counts = [(int(np.sum(self.verdicts[:, place] == k)), k) for k in range(len(VERDICTS))]
        return VERDICTS[max(counts)[1]]


def identifiability(precision: FloatArray, values: FloatArray, space: ParameterSpace) -> Identifiability:
    """Identifiability at values (N, d) from the precision (N, d, d) of an estimate."""
    size = len(space)
    failed = np.asarray(~np.isfinite(precision).all(axis=(1, 2)))
    known = np.where(failed[:, None, None], 0.0, precision)
    covariance = np.asarray(np.linalg.inv(known + BOX_PRECISION * np.eye(size)), dtype=float)
    place = space.to_unit(values)
    sd = np.stack([bounded_sd(own, -at, 1 - at) for own, at in zip(known, place, strict=True)])
    # a parameter's own bounds narrow its estimate without any information
    free = np.maximum(1 / np.diagonal(covariance, axis1=1, axis2=2) - BOX_PRECISION, BOX_PRECISION) ** -0.5
    diagonal = np.maximum(np.diagonal(known, axis1=1, axis2=2), np.finfo(float).tiny)
    conditional = np.minimum(diagonal**-0.5, BOX_SD)
    size_of = relative_size(space, values)
    low, high = place - SETTINGS.one_sided * free > 0, place + SETTINGS.one_sided * free < 1
    verdicts = np.select(
        [is_identifiable(np.maximum(sd, free), size_of), is_identifiable(conditional, size_of), low != high],
        [0, 1, 2],
        3,
    )
    return Identifiability(
        sd=sd,
        relative_sd=sd / size_of,
        conditional_sd=conditional,
        variance_inflation=(sd / conditional) ** 2,
        covariance=covariance,
        verdicts=np.where(failed[:, None], -1, verdicts),
    )


def relative_size(space: ParameterSpace, values: FloatArray) -> FloatArray:
    """What a relative standard deviation is relative to, in the unit cube, (N, d): see `criteria.scales`."""
    return np.asarray(scales(space, values) / space.derivative(values))


def is_identifiable(sd: FloatArray, size: FloatArray) -> NDArray[np.bool_]:
    """Whether standard deviations in the unit cube are small enough for parameters of this relative size."""
    return np.asarray((sd <= SETTINGS.share_of_value * size) | (sd <= SETTINGS.share_of_box))


def correlated_parameters(covariance: FloatArray, place: int, size: float) -> list[int]:
    """Parameters that, once known, make this one identifiable; the most helpful first, one if one is enough.

    Parameters
    ----------
    covariance
        With the bounds, (d, d).
    place
        Which parameter.
    size
        Its relative size in the unit cube.
    """
    found: list[int] = []
    rest = [k for k in range(len(covariance)) if k != place]
    left = covariance.copy()
    while rest and len(found) < SETTINGS.most_correlated:
        if found and is_identifiable(np.sqrt(left[place, place]), np.asarray(size)):
            break
        gains = [left[place, k] ** 2 / left[k, k] for k in rest]
        best = rest.pop(int(np.argmax(gains)))
        found.append(best)
        left = left - np.outer(left[best], left[best]) / left[best, best]
    return found


def condition_indices(precision: FloatArray) -> FloatArray:
    r"""Condition indices :math:`\sqrt{\lambda_{\max} / \lambda_i}` of a precision (d, d) scaled to unit diagonal.

    Ascending. Above 30, parameters are strongly collinear (Belsley, Kuh & Welsch, "Regression diagnostics", 1980).
    """
    size = np.sqrt(np.maximum(np.diag(precision), np.finfo(float).tiny))
    eigenvalues = np.linalg.eigvalsh(precision / np.outer(size, size))
    return np.asarray(np.sqrt(eigenvalues[-1] / np.maximum(eigenvalues[::-1], np.finfo(float).tiny)))
