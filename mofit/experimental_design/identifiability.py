r"""Practical identifiability of each parameter from the precision of its estimate.

All in the unit cube of the parameters' bounds. With the precision M of the estimate, calibration stages included, and
that of the bounds B = 12 I (a uniform distribution),

- the *marginal* standard deviation of a parameter is that of its estimate, all others estimated along with it, within
  their bounds (`bounded_sd`);
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
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.experimental_design.criteria import scales
from mofit.parameters import ParameterSpace

IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT = "identifiable", "only in a combination", "one-sided", "not identifiable"
#: From good to bad.
VERDICTS = (IDENTIFIABLE, COMBINATION, ONE_SIDED, NOT)

#: Precision of a parameter that is uniform over its box, and the standard deviation that goes with it.
BOX_PRECISION = 12.0
BOX_SD = BOX_PRECISION**-0.5


@dataclass(frozen=True)
class IdentifiabilitySettings:
    """Where verdicts change, and numbers of `bounded_sd`."""

    share_of_value: float = 0.25
    """Largest standard deviation of an identifiable parameter over its value: its sign and size are certain."""
    share_of_box: float = 0.05
    """The same over its box, for values near zero: the tests leave a sixth of the prior's width."""
    one_sided: float = 1.645
    """A bound within so many standard deviations is not excluded (95 %, one side)."""
    most_correlated: int = 3
    """Most correlated parameters that are named: more do not help to understand."""
    draws: int = 512
    """Antithetic draws: a standard deviation from 512 has an error of about 3 %."""
    near: float = 2.5
    """A bound within so many standard deviations is near: farther ones stop 1 % of the estimates."""
    most_fixed: int = 4
    """Parameters at most that are fixed at a bound, the nearest first; four take 81 solutions."""
    tolerance: float = 1e-9
    """Rounding that a solution may be beyond a bound, relative to its width."""


SETTINGS = IdentifiabilitySettings()


@dataclass(frozen=True)
class Identifiability:
    """Of d parameters at N samples; standard deviations in the unit cube, shapes (N, d)."""

    sd: FloatArray
    """Marginal: of the estimate within its bounds."""
    relative_sd: FloatArray
    """The same over the magnitude of the value (`mofit.experimental_design.criteria.scales`)."""
    conditional_sd: FloatArray
    """All other parameters known."""
    variance_inflation: FloatArray
    """Variance inflation factor, (marginal / conditional)²."""
    covariance: FloatArray
    """With the bounds as a prior, (N, d, d)."""
    verdicts: NDArray[np.int64]
    """Place of the verdict in `VERDICTS`; -1 where the simulation fails."""

    def verdict(self, place: int) -> str:
        """The most frequent verdict on a parameter over the samples that could be simulated; the worse of a tie."""
        counts = [(int(np.sum(self.verdicts[:, place] == k)), k) for k in range(len(VERDICTS))]
        return VERDICTS[max(counts)[1]]


def identifiability(precision: FloatArray, values: FloatArray, space: ParameterSpace) -> Identifiability:
    """Identifiability at values (N, d) from the precision (N, d, d) of an estimate."""
    failed = np.asarray(~np.isfinite(precision).all(axis=(1, 2)))
    known = np.where(failed[:, None, None], 0.0, precision)
    covariance = np.asarray(np.linalg.inv(known + BOX_PRECISION * np.eye(len(space))), dtype=float)
    place = space.to_unit(values)
    sd = np.stack([bounded_sd(own, -at, 1 - at) for own, at in zip(known, place, strict=True)])
    # a parameter's own bounds narrow its estimate without any information
    free = np.maximum(1 / np.diagonal(covariance, axis1=1, axis2=2) - BOX_PRECISION, BOX_PRECISION) ** -0.5
    diagonal = np.maximum(np.diagonal(known, axis1=1, axis2=2), np.finfo(float).tiny)
    conditional = np.minimum(diagonal**-0.5, BOX_SD)
    size = relative_size(space, values)
    low, high = place - SETTINGS.one_sided * free > 0, place + SETTINGS.one_sided * free < 1
    verdicts = np.select(
        [is_identifiable(np.maximum(sd, free), size), is_identifiable(conditional, size), low != high],
        [0, 1, 2],
        3,
    )
    return Identifiability(
        sd=sd,
        relative_sd=sd / size,
        conditional_sd=conditional,
        variance_inflation=(sd / conditional) ** 2,
        covariance=covariance,
        verdicts=np.where(failed[:, None], -1, verdicts),
    )


def relative_size(space: ParameterSpace, values: FloatArray) -> FloatArray:
    """What a relative standard deviation is relative to, in the unit cube, (N, d): see `criteria.scales`."""
    return np.asarray(scales(space, values) / space.derivative(values))


def is_identifiable(sd: float | FloatArray, size: float | FloatArray) -> NDArray[np.bool_]:
    """Whether standard deviations in the unit cube are small enough for parameters of this relative size."""
    return np.asarray(sd <= np.maximum(SETTINGS.share_of_value * size, SETTINGS.share_of_box))


def correlated_parameters(covariance: FloatArray, place: int, size: float) -> list[int]:
    """Parameters that, once known, make one identifiable; the most helpful first, one if one is enough.

    The one is at a place in the covariance (d, d), which includes the bounds; it has a relative size in the unit cube.
    """
    found: list[int] = []
    rest = [k for k in range(len(covariance)) if k != place]
    left = covariance.copy()
    while rest and len(found) < SETTINGS.most_correlated:
        if found and is_identifiable(np.sqrt(left[place, place]), size):
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


def bounded_sd(precision: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    r"""Standard deviation (d,) of an estimate that is confined to bounds.

    Near the truth the cost is quadratic and its gradient is random. With the precision M the estimate is

    .. math:: \hat w = \arg\min_{l \le w \le h} \tfrac12 w^T M w - g^T w, \qquad g \sim N(0, M)

    Where no bound is near, its covariance is :math:`M^{-1}`. Else the problem is solved exactly for a fixed set of
    draws of g: the parameters that may reach a bound are few, and all ways to fix them there are tried.

    Parameters
    ----------
    precision
        M, positive semi-definite, (d, d).
    low, high
        Lower (not positive) and upper (not negative) bound relative to the truth, (d,).
    """
    width = high - low
    # without a floor, a parameter without information would have an infinite variance
    floor = precision + np.diag(1e-6 / width**2)
    free = np.sqrt(np.diag(np.linalg.inv(floor)))
    distance = np.minimum(-low, high) / free
    near = [int(k) for k in np.argsort(distance) if distance[k] < SETTINGS.near][: SETTINGS.most_fixed]
    if not near:
        return np.asarray(free)
    gradients = balanced_draws(len(precision), SETTINGS.draws) @ np.linalg.cholesky(floor).T
    return np.asarray(bounded_minima(floor, gradients, low, high, near).std(axis=0))


def balanced_draws(size: int, count: int) -> FloatArray:
    """Standard normal draws of zero mean and exactly unit covariance, (count, size)."""
    half = np.random.default_rng(0).standard_normal((count // 2, size))
    half = half @ np.linalg.inv(np.linalg.cholesky(half.T @ half / len(half))).T
    return np.concatenate([half, -half])


def bounded_minima(
    precision: FloatArray, gradients: FloatArray, low: FloatArray, high: FloatArray, near: list[int]
) -> FloatArray:
    """Minima for gradients (n, d): of all ways to fix the ``near`` parameters, the feasible one of least cost."""
    best = np.full(len(gradients), np.inf)
    found = np.zeros_like(gradients)
    slack = SETTINGS.tolerance * (high - low)[near]
    for way in product((0, -1, 1), repeat=len(near)):
        fixed = [k for k, end in zip(near, way, strict=True) if end]
        ends = np.array([low[k] if end < 0 else high[k] for k, end in zip(near, way, strict=True) if end])
        others = [k for k in range(len(precision)) if k not in fixed]
        trial = np.empty_like(gradients)
        trial[:, fixed] = ends
        right = gradients[:, others] - (precision[np.ix_(others, fixed)] @ ends if fixed else 0.0)
        trial[:, others] = np.linalg.solve(precision[np.ix_(others, others)], right.T).T
        inside = np.all((trial[:, near] >= low[near] - slack) & (trial[:, near] <= high[near] + slack), axis=1)
        cost = 0.5 * np.einsum("ni,ij,nj->n", trial, precision, trial) - np.sum(gradients * trial, axis=1)
        better = inside & (cost < best)
        best[better], found[better] = cost[better], trial[better]
    return found
