r"""How far estimates scatter that their bounds stop.

Near the truth the misfit is a parabola whose slope is noise: with the precision M the estimate is

.. math:: \hat w = \arg\min_{l \le w \le h} \tfrac12 w^T M w - g^T w, \qquad g \sim N(0, M)

away from it, which has the covariance :math:`M^{-1}` where no bound is near. Else the problem is solved for a fixed set
of draws of g, exactly: the parameters that may reach a bound are few, and all ways to hold them are tried.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Draws, every second one the negative of the one before.
DRAWS = 512
#: A bound within so many standard deviations is near; so many parameters at most are held at theirs.
_NEAR, _MOST = 2.5, 4
#: Rounding that a multiplier or a bound may be off, relative to its size.
_SLACK = 1e-9


def bounded_sd(precision: Array, low: Array, high: Array) -> Array:
    """Standard deviation of the estimate, (d,), from the precision (d, d) and the distances to the bounds, (d,) each.

    Parameters
    ----------
    precision
        Positive semi-definite.
    low, high
        Lower (not positive) and upper (not negative) bound relative to the truth.
    """
    size = len(precision)
    width = high - low
    # a parameter of which nothing is known would roam without end
    floor = precision + np.diag(1e-6 / width**2)
    free = np.sqrt(np.diag(np.linalg.inv(floor)))
    distance = np.minimum(-low, high) / free
    near = [int(k) for k in np.argsort(distance) if distance[k] < _NEAR][:_MOST]
    if not near:
        return np.asarray(free)
    root = np.linalg.cholesky(floor)
    slopes = _draws(size) @ root.T
    return np.asarray(_solve(floor, slopes, low, high, near).std(axis=0))


def _draws(size: int) -> Array:
    """Standard normal draws of exactly unit covariance, (DRAWS, size)."""
    half = np.random.default_rng(0).standard_normal((DRAWS // 2, size))
    half = half @ np.linalg.inv(np.linalg.cholesky(half.T @ half / len(half))).T
    return np.concatenate([half, -half])


def _solve(precision: Array, slopes: Array, low: Array, high: Array, near: list[int]) -> Array:
    """Minimisers for slopes (n, d): of all ways to hold the ``near`` ones, the feasible one of least misfit."""
    best = np.full(len(slopes), np.inf)
    found = np.zeros_like(slopes)
    slack = _SLACK * (high - low)[near]
    for way in product((0, -1, 1), repeat=len(near)):
        held = [k for k, end in zip(near, way, strict=True) if end]
        ends = np.array([low[k] if end < 0 else high[k] for k, end in zip(near, way, strict=True) if end])
        others = [k for k in range(len(precision)) if k not in held]
        trial = np.empty_like(slopes)
        trial[:, held] = ends
        right = slopes[:, others] - (precision[np.ix_(others, held)] @ ends if held else 0.0)
        trial[:, others] = np.linalg.solve(precision[np.ix_(others, others)], right.T).T
        inside = np.all((trial[:, near] >= low[near] - slack) & (trial[:, near] <= high[near] + slack), axis=1)
        misfit = 0.5 * np.einsum("ni,ij,nj->n", trial, precision, trial) - np.sum(slopes * trial, axis=1)
        better = inside & (misfit < best)
        best[better], found[better] = misfit[better], trial[better]
    return found
