r"""What tests will say of a parameter, in words, from the precision that the estimate will have.

All in the unit cube of the parameters' bounds. With the precision M of the estimate, calibration stages included, and
that of the bounds B = 12 I (a uniform spread),

- the *marginal* standard deviation of a parameter is that of its estimate, all others estimated along with it, within
  their bounds (`mofit.identifiability.bounded`);
- the *conditional* one, :math:`M_{ii}^{-1/2}`, has them known.

==========================  ===========================================================================================
verdict                     means
==========================  ===========================================================================================
identifiable                the marginal standard deviation is at most a quarter of the value, or 5 % of the box, and
                            would be without the parameter's own bounds
only in a combination       not so, but the conditional one is: others can make up for a change of this parameter
one-sided                   neither, but the data rule out one of the bounds: a limit can be given
not identifiable            neither, and no limit either
==========================  ===========================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.bounded import bounded_sd
from mofit.identifiability.criteria import scales
from mofit.parameters import ParameterSpace

Array = NDArray[np.float64]

IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT = "identifiable", "only in a combination", "one-sided", "not identifiable"
#: From good to bad.
VERDICTS = (IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT)

#: Largest standard deviation of an identifiable parameter: share of its value, or of its box for values near zero.
SHARE_OF_VALUE = 0.25
SHARE_OF_BOX = 0.05
#: Precision of a parameter that is uniform over its box, and the standard deviation that goes with it.
BOX_PRECISION = 12.0
BOX_SD = BOX_PRECISION**-0.5
#: Standard deviations from a bound within which it is not ruled out (95 %, one side).
_WITHIN = 1.645
#: Most partners that are named in a combination.
_PARTNERS = 3


@dataclass(frozen=True)
class Spread:
    """What N parameter sets let expect of d parameters; standard deviations in the unit cube, shapes (N, d).

    Parameters
    ----------
    sd
        Marginal: of the estimate, which its bounds may stop.
    relative
        The same over the magnitude of the value (values near 0: over a hundredth of the box).
    conditional
        All other parameters known.
    inflation
        Variance inflation factor, (marginal / conditional)².
    covariance
        With the bounds, (N, d, d).
    words
        Place of the verdict in `VERDICTS`; -1 where the model fails.
    """

    sd: Array
    relative: Array
    conditional: Array
    inflation: Array
    covariance: Array
    words: NDArray[np.int64]


def spread(precision: Array, values: Array, space: ParameterSpace) -> Spread:
    """Judge the precision (N, d, d) of an estimate at values (N, d)."""
    size = len(space)
    failed = np.asarray(~np.isfinite(precision).all(axis=(1, 2)))
    known = np.where(failed[:, None, None], 0.0, precision)
    covariance = np.asarray(np.linalg.inv(known + BOX_PRECISION * np.eye(size)), dtype=float)
    place = space.to_unit(values)
    sd = np.stack([bounded_sd(own, -at, 1 - at) for own, at in zip(known, place, strict=True)])
    # what a parameter's own bounds do to its estimate is no knowledge
    free = np.maximum(1 / np.diagonal(covariance, axis1=1, axis2=2) - BOX_PRECISION, BOX_PRECISION) ** -0.5
    diagonal = np.maximum(np.diagonal(known, axis1=1, axis2=2), np.finfo(float).tiny)
    conditional = np.minimum(diagonal**-0.5, BOX_SD)
    size_of = relative_size(space, values)
    low, high = place - _WITHIN * free > 0, place + _WITHIN * free < 1
    words = np.select([good(np.maximum(sd, free), size_of), good(conditional, size_of), low != high], [0, 1, 2], 3)
    return Spread(
        sd=sd,
        relative=sd / size_of,
        conditional=conditional,
        inflation=(sd / conditional) ** 2,
        covariance=covariance,
        words=np.where(failed[:, None], -1, words),
    )


def relative_size(space: ParameterSpace, values: Array) -> Array:
    """What a relative standard deviation is relative to, in the unit cube, (N, d): see `criteria.scales`."""
    return np.asarray(scales(space, values) / space.slope(values))


def good(sd: Array, size: Array) -> NDArray[np.bool_]:
    """Whether standard deviations in the unit cube are those of identifiable parameters of this size there."""
    return np.asarray((sd <= SHARE_OF_VALUE * size) | (sd <= SHARE_OF_BOX))


def partners(covariance: Array, place: int, size: float) -> list[int]:
    """Parameters that, once known, make this one identifiable; the most helpful first, one if one is enough.

    Parameters
    ----------
    covariance
        With the bounds, (d, d).
    place
        Which parameter.
    size
        Its value in the unit cube's scale.
    """
    found: list[int] = []
    rest = [k for k in range(len(covariance)) if k != place]
    left = covariance.copy()
    while rest and len(found) < _PARTNERS and not (found and good(np.sqrt(left[place, place]), np.asarray(size))):
        gains = [left[place, k] ** 2 / left[k, k] for k in rest]
        best = rest.pop(int(np.argmax(gains)))
        found.append(best)
        left = left - np.outer(left[best], left[best]) / left[best, best]
    return found


def condition_indices(precision: Array) -> Array:
    r"""Condition indices :math:`\sqrt{\lambda_{\max} / \lambda_i}` of a precision (d, d) scaled to unit diagonal.

    Ascending. Above 30, parameters are strongly collinear (Belsley, Kuh & Welsch, "Regression diagnostics", 1980).
    """
    size = np.sqrt(np.maximum(np.diag(precision), np.finfo(float).tiny))
    eigenvalues = np.linalg.eigvalsh(precision / np.outer(size, size))
    return np.asarray(np.sqrt(eigenvalues[-1] / np.maximum(eigenvalues[::-1], np.finfo(float).tiny)))
