r"""Standard deviation of an estimate that is confined to bounds.

Near the truth the cost is quadratic and its gradient is random. With the precision M the estimate is

.. math:: \hat w = \arg\min_{l \le w \le h} \tfrac12 w^T M w - g^T w, \qquad g \sim N(0, M)

Where no bound is near, its covariance is :math:`M^{-1}`. Else the problem is solved exactly for a fixed set of draws of
g: the parameters that may reach a bound are few, and all ways to fix them there are tried.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from mofit._typing import FloatArray


@dataclass(frozen=True)
class BoundedSettings:
    """Numbers of the method.

    Parameters
    ----------
    draws
        Antithetic draws: a standard deviation from 512 has an error of about 3 %.
    near
        A bound within so many standard deviations is near: farther ones stop 1 % of the estimates.
    most
        Parameters at most that are fixed at a bound, the nearest first; four take 81 solutions.
    tolerance
        Rounding that a solution may be beyond a bound, relative to its width.
    """

    draws: int = 512
    near: float = 2.5
    most: int = 4
    tolerance: float = 1e-9


_SETTINGS = BoundedSettings()


def bounded_sd(
    precision: FloatArray, low: FloatArray, high: FloatArray, settings: BoundedSettings = _SETTINGS
) -> FloatArray:
    """Standard deviation of the estimate, (d,), from the precision (d, d) and the distances to the bounds, (d,) each.

    Parameters
    ----------
    precision
        Positive semi-definite.
    low, high
        Lower (not positive) and upper (not negative) bound relative to the truth.
    settings
        Numbers of the method.
    """
    width = high - low
    # without a floor, a parameter without information would have an infinite variance
    floor = precision + np.diag(1e-6 / width**2)
    free = np.sqrt(np.diag(np.linalg.inv(floor)))
    distance = np.minimum(-low, high) / free
    near = [int(k) for k in np.argsort(distance) if distance[k] < settings.near][: settings.most]
    if not near:
        return np.asarray(free)
    gradients = balanced_draws(len(precision), settings.draws) @ np.linalg.cholesky(floor).T
    return np.asarray(bounded_minima(floor, gradients, low, high, near, settings).std(axis=0))


def balanced_draws(size: int, count: int) -> FloatArray:
    """Standard normal draws of zero mean and exactly unit covariance, (count, size)."""
    half = np.random.default_rng(0).standard_normal((count // 2, size))
    half = half @ np.linalg.inv(np.linalg.cholesky(half.T @ half / len(half))).T
    return np.concatenate([half, -half])


def bounded_minima(
    precision: FloatArray,
    gradients: FloatArray,
    low: FloatArray,
    high: FloatArray,
    near: list[int],
    settings: BoundedSettings = _SETTINGS,
) -> FloatArray:
    """Minima for gradients (n, d): of all ways to fix the ``near`` parameters, the feasible one of least cost."""
    best = np.full(len(gradients), np.inf)
    found = np.zeros_like(gradients)
    slack = settings.tolerance * (high - low)[near]
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
