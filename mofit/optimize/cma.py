"""Covariance matrix adaptation from many starts together: a local search that needs no gradient."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray

#: What a failed evaluation counts: worse than any other, and still a number.
_FAILED = 1e300


@dataclass
class Runs:
    """Where runs of `adapt` are; a stop rule sees it after every generation.

    Parameters
    ----------
    mean
        Of the normal distribution of each run, shape (run, d).
    first_step, size
        First standard deviation of the distribution, and now along its longest axis, shape (run,).
    points, cost
        Best point so far and its cost, shapes (run, d) and (run,).
    spread
        Cost of the middle of the last generation above its best.
    active
        Whether the run goes on.
    converged
        Whether it came to its end: no other rule stopped it, and the budget sufficed.
    """

    mean: FloatArray
    first_step: FloatArray
    size: FloatArray
    points: FloatArray
    cost: FloatArray
    spread: FloatArray
    active: NDArray[np.bool_]
    converged: NDArray[np.bool_]


class _Weights:
    """Constants of the strategy for a dimension and a population, all as Hansen (2016) recommends."""

    def __init__(self, d: int, population: int) -> None:
        self.parents = population // 2
        raw = np.log((population + 1) / 2) - np.log(np.arange(1, self.parents + 1))
        self.w = raw / raw.sum()
        self.mass = mass = float(1 / np.sum(self.w**2))
        self.path = (4 + mass / d) / (d + 4 + 2 * mass / d)
        self.step_path = (mass + 2) / (d + mass + 5)
        self.one = 2 / ((d + 1.3) ** 2 + mass)
        self.mu = min(1 - self.one, 2 * (mass - 2 + 1 / mass) / ((d + 2) ** 2 + mass))
        self.damping = 1 + 2 * max(0.0, ((mass - 1) / (d + 1)) ** 0.5 - 1) + self.step_path
        self.normal = d**0.5 * (1 - 1 / (4 * d) + 1 / (21 * d**2))  # expected length of a standard normal vector
        self.every = max(1, int(1 / ((self.one + self.mu) * d * 10)))  # generations between decompositions
        self.stagnation = 10 + int(np.ceil(30 * d / population))


def default_population(dimension: int) -> int:
    """Smallest population that Hansen (2016) recommends, at least 6."""
    return max(6, 4 + int(3 * np.log(dimension)))


def adapt(
    evaluate: Callable[[FloatArray], FloatArray],
    starts: FloatArray,
    steps: FloatArray,
    rng: np.random.Generator,
    population: int | None = None,
    stop: Callable[[Runs], NDArray[np.bool_]] | None = None,
    tolerance: float = 1e-13,
) -> Runs:
    r"""CMA-ES from several starts in the unit cube, one generation of all runs per call of the function.

    A run draws its population from :math:`N(m, \sigma^2 C)`, clipped to the cube, moves :math:`m` to the weighted mean
    of the better half, and adapts :math:`C` and :math:`\sigma` to its steps. It sees the ranks of the values alone, so
    that kinks, noise and structure finer than :math:`\sigma` do not mislead it.

    Parameters
    ----------
    evaluate
        Points (N, d) to costs, (N,) or fewer where a budget does not allow all: then all runs end.
    starts
        First means, shape (run, d).
    steps
        First standard deviations, shape (run,).
    rng
        Draws the populations.
    population
        Points per generation of a run; None: `default_population`.
    stop
        Which runs to give up, shape (run,), asked after every generation.
    tolerance
        A run has converged where its distribution is narrower, or where it finds nothing better any more: a fractal
        function has structure down to rounding.

    References
    ----------
    Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772 (2016).
    """
    count, d = starts.shape
    size = population or default_population(d)
    k = _Weights(d, size)
    step = np.array(np.broadcast_to(steps, count), dtype=float)
    covariance = np.tile(np.eye(d), (count, 1, 1))
    axes, lengths = covariance.copy(), np.ones((count, d))
    path, step_path = np.zeros((count, d)), np.zeros((count, d))
    recent = np.full((count, 2 * k.stagnation), np.inf)
    runs = Runs(
        starts.copy(), step.copy(), step.copy(), starts.copy(), np.full(count, np.inf), np.full(count, np.inf),
        np.ones(count, dtype=bool), np.zeros(count, dtype=bool),
    )  # fmt: skip
    generation = 0
    while runs.active.any():
        a = np.flatnonzero(runs.active)
        each = np.arange(len(a))
        if generation % k.every == 0:
            squares, axes[a] = np.linalg.eigh((covariance[a] + covariance[a].transpose(0, 2, 1)) / 2)
            lengths[a] = np.sqrt(np.maximum(squares, 1e-20))
        generation += 1
        wide, mean = step[a][:, None, None], runs.mean[a][:, None]
        moves = (rng.standard_normal((len(a), size, d)) * lengths[a][:, None]) @ axes[a].transpose(0, 2, 1)
        points = np.clip(mean + wide * moves, 0.0, 1.0)
        moves = (points - mean) / wide
        found = evaluate(points.reshape(-1, d))
        if len(found) < len(a) * size:
            break
        cost = np.where(np.isfinite(found), found, _FAILED).reshape(len(a), size)
        order = np.argsort(cost, axis=1, kind="stable")
        better = moves[each[:, None], order[:, : k.parents]]
        move = np.einsum("m,kmd->kd", k.w, better)
        runs.mean[a] += step[a][:, None] * move
        white = np.einsum("kij,kj->ki", axes[a], np.einsum("kji,kj->ki", axes[a], move) / lengths[a])
        step_path[a] = (1 - k.step_path) * step_path[a] + (k.step_path * (2 - k.step_path) * k.mass) ** 0.5 * white
        length = np.linalg.norm(step_path[a], axis=1)
        short = length / np.sqrt(1 - (1 - k.step_path) ** (2 * generation)) < (1.4 + 2 / (d + 1)) * k.normal
        path[a] = (1 - k.path) * path[a] + (short * (k.path * (2 - k.path) * k.mass) ** 0.5)[:, None] * move
        terms = np.concatenate([k.one**0.5 * path[a][:, None], (k.mu * k.w[:, None]) ** 0.5 * better], axis=1)
        kept = 1 - k.one - k.mu + ~short * k.one * k.path * (2 - k.path)
        covariance[a] = kept[:, None, None] * covariance[a] + terms.transpose(0, 2, 1) @ terms
        step[a] *= np.exp(np.minimum(1.0, k.step_path / k.damping * (length / k.normal - 1)))

        best = cost[each, order[:, 0]]
        lower = best < runs.cost[a]
        runs.points[a[lower]], runs.cost[a[lower]] = points[each, order[:, 0]][lower], best[lower]
        runs.size[a], runs.spread[a] = step[a] * lengths[a].max(axis=1), cost[each, order[:, k.parents]] - best
        recent[a] = np.concatenate([best[:, None], recent[a][:, :-1]], axis=1)
        old, new = recent[a][:, k.stagnation :], recent[a][:, : k.stagnation]
        ended = (runs.size[a] < tolerance) | (np.isfinite(old[:, -1]) & (new.min(axis=1) >= old.min(axis=1)))
        runs.converged[a], runs.active[a] = ended, ~ended
        if stop is not None:
            runs.active &= ~stop(runs)
    runs.active[:] = False
    return runs
