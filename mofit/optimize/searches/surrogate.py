"""Bayesian optimisation with a Gaussian-process surrogate: few evaluations, for expensive models."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.gaussian_process import GaussianProcess, fit_lengths
from mofit.optimize.global_search import (
    Gradients,
    Iteration,
    Objectives,
    Progress,
    SearchResult,
    normalised_weights,
    weighted_sum,
)
from mofit.optimize.pareto_front import nondominated
from mofit.optimize.searches import mlsl


@dataclass(frozen=True)
class SurrogateSettings:
    """Settings of `search`. Lengths are shares of the box."""

    evaluations: int = 300
    """Budget."""
    start: int = 64
    """Sobol points before the first surrogate; half of them for budgets under 100."""
    batch: int = 10
    """Points evaluated per surrogate."""
    explore: int = 2
    """How many of them go where the surrogate is least certain."""
    candidates: int = 256
    """Sobol points at which the uncertainty is evaluated; a power of two fills the box evenly."""
    refit: float = 1.35
    """Length scales are fitted again when the number of points has grown by this factor."""
    confirmed: float = 2e-3
    """A minimum of the surrogate with an evaluated point so near is confirmed."""
    matched: float = 0.02
    """At the end, a minimum of the surrogate is archived if an evaluated point lies so near; nothing is tried so close
    to a failure."""
    certain: float = 0.02
    """Stop when all minima are confirmed and the surrogate's standard deviation is nowhere above this share of the
    function's."""
    inner: mlsl.MlslSettings = field(
        default_factory=lambda: mlsl.MlslSettings(evaluations=1500, final_tolerance=2e-4, front_share=0.0)
    )
    """Settings of the search on the surrogate, whose evaluations are cheap."""


def with_budget(evaluations: int) -> SurrogateSettings:
    """The settings with another budget."""
    return SurrogateSettings(evaluations=evaluations)


def search(
    objectives: Objectives,
    gradients: Gradients,
    dimension: int,
    rng: np.random.Generator,
    settings: SurrogateSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Find all minima by Bayesian optimisation: few evaluations, no gradients.

    A Gaussian process (`GaussianProcess`, one output per objective) is fitted to all evaluated points. MLSL finds the
    minima of its mean, for the weighted mean of the objectives and for each singly. Those without an evaluated point
    near are evaluated, in turn the lowest and the least certain, and a few points of greatest uncertainty. This repeats
    until the budget is spent, or all minima are confirmed and the surrogate is certain.

    Parameters
    ----------
    objectives
        Maps points (N, d) of the unit cube to objective vectors (N, T), nan where it fails; failures are left out of
        the process, and nothing is tried close to them again.
    gradients
        Not used.
    dimension, rng, settings, progress
        Number of coordinates d, the only source of randomness, constants, and a callback
        ``progress(evaluations, budget, note)``.
    weights
        Weights of the objectives, shape (T,), none negative; equal if not given.

    Raises
    ------
    InputError
        If the weights do not fit, or if too many of the first points failed.
    """
    from scipy.stats import qmc  # late: its import takes half a second

    settings = settings or SurrogateSettings()
    log = EvaluationLog(objectives, gradients, dimension, settings.evaluations)
    first = settings.start if settings.evaluations >= 100 else settings.start // 2
    sequence = qmc.Sobol(dimension, rng=rng)
    _, values = log.evaluate(sequence.random(first))
    weights = normalised_weights(weights, values.shape[1])
    if np.isfinite(weighted_sum(values, weights)).sum() < 2 * dimension + 2:
        raise InputError.of("search", f"too many of {len(values)} start points failed", "Narrow the bounds")
    history: list[Iteration] = []
    lengths, fitted = None, 0.0
    while True:
        usable = np.isfinite(log.values).all(axis=1)
        if lengths is None or usable.sum() >= settings.refit * fitted:
            lengths = fit_lengths(log.points[usable], log.values[usable], rng, lengths)
            fitted = float(usable.sum())
        process = GaussianProcess(log.points[usable], log.values[usable], lengths)
        inner = mlsl.search(process.mean, process.mean_and_slope, dimension, rng, settings.inner, weights)
        minima = inner.archived_points
        best = float(weighted_sum(log.values, weights).min())
        history.append(Iteration(log.used, best, len(minima), 0.0))
        if progress is not None:
            progress(log.used, log.budget, f"best {best:.4g}, {len(minima)} minima of the surrogate")
        candidates = sequence.random(settings.candidates)
        deviation = process.deviation(candidates)
        unconfirmed = minima[~_near(minima, log.points, settings.confirmed)]
        if log.left == 0 or (len(unconfirmed) == 0 and deviation.max() < settings.certain):
            break
        chosen = _chosen(unconfirmed, process, weights, settings.batch - settings.explore)
        least_certain = candidates[np.argsort(-deviation)[: settings.batch - len(chosen)]]
        points = np.concatenate([chosen, least_certain])
        log.evaluate(points[~_near(points, log.points[~usable], settings.matched)])
    return _result(log, weights, minima, history, settings)


def _near(points: FloatArray, others: FloatArray, radius: float) -> NDArray[np.bool_]:
    """Which points (N, d) have one of the others within the radius."""
    if len(points) == 0 or len(others) == 0:
        return np.zeros(len(points), dtype=bool)
    gaps = np.linalg.norm(points[:, None] - others[None], axis=-1)
    return np.asarray(gaps.min(axis=1) < radius)


def _chosen(points: FloatArray, process: GaussianProcess, weights: FloatArray, most: int) -> FloatArray:
    """Of the points, in turn the one of lowest mean and the one of greatest uncertainty."""
    if len(points) <= most:
        return points
    queues = [
        list(np.argsort(weighted_sum(process.mean(points), weights))),
        list(np.argsort(-process.deviation(points))),
    ]
    taken: list[int] = []
    while len(taken) < most:
        queue = queues[len(taken) % 2]
        taken.append(next(int(k) for k in queue if k not in taken))
    return points[taken]


def _result(
    log: EvaluationLog,
    weights: FloatArray,
    minima: FloatArray,
    history: list[Iteration],
    settings: SurrogateSettings,
) -> SearchResult:
    points, values = log.points, log.values
    cost = weighted_sum(values, weights)
    gaps = np.linalg.norm(minima[:, None] - points[None], axis=-1)
    near = [np.flatnonzero(row < settings.matched) for row in gaps]
    archived = [int(rows[np.argmin(gaps[k][rows])]) for k, rows in enumerate(near) if len(rows)]
    archived = sorted(dict.fromkeys(archived), key=lambda row: float(cost[row]))
    order = np.argsort(cost, kind="stable")[: len(cost) // 2]
    return SearchResult(
        points=points,
        objectives=values,
        cost=cost,
        archived=np.array(archived or [int(np.argmin(cost))], dtype=np.int64),
        population=order,
        labels=np.zeros(len(order), dtype=np.int64),
        front=nondominated(values),
        history=tuple(history),
    )
