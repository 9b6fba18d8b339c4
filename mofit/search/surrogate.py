"""A search for expensive models: the minima of a Gaussian-process surrogate are the niches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import InputError
from mofit.parameters import Array
from mofit.search.front import nondominated
from mofit.search.gaussian_process import GaussianProcess, fit_lengths
from mofit.search.ledger import Ledger, Objectives
from mofit.search.minima import Minima
from mofit.search.niching import NichingSettings, niching
from mofit.search.result import Iteration, Progress, SearchResult, normalised_weights
from mofit.sobol import sobol


@dataclass(frozen=True)
class SurrogateSettings:
    """Settings of `surrogate`. Lengths are shares of the box."""

    evaluations: int = 300
    """Budget."""
    start: int = 64
    """Sobol points before the first surrogate; half of them for budgets under 100."""
    batch: int = 10
    """Points evaluated per surrogate."""
    explore: int = 2
    """How many of them go where the surrogate knows least."""
    growth: float = 1.35
    """Length scales are fitted anew when the number of points has grown by this factor."""
    confirmed: float = 2e-3
    """A minimum of the surrogate with an evaluated point so near is confirmed."""
    claimed: float = 0.02
    """At the end, a minimum of the surrogate is stored if an evaluated point lies so near."""
    settled: float = 0.02
    """Stop when all minima are confirmed and the surrogate's standard deviation is nowhere above this share of the
    function's."""
    inner: int = 1500
    """Budget of the search on the surrogate."""


def surrogate(
    objectives: Objectives,
    dimension: int,
    rng: np.random.Generator,
    settings: SurrogateSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Find all minima with few evaluations and no gradients.

    A Gaussian process (`GaussianProcess`, one output per objective) is fitted to all points evaluated so far; `niching`
    finds the minima of its mean, for the weighted mean of the objectives and for each alone. Those without an evaluated
    point near by are evaluated, turn by turn the lowest and the least certain, and a few points where the process knows
    least. So on until the budget is spent or nothing is left to learn.

    Parameters
    ----------
    objectives
        Maps points (N, d) of the unit cube to objective vectors (N, T), nan where it fails; failures are left out of
        the process, and nothing is tried close to them again.
    dimension
        Number of coordinates d.
    rng
        The only source of randomness.
    settings
        Constants.
    weights
        Weights of the objectives, shape (T,), none negative; equal if not given.
    progress
        Called as ``progress(evaluations, budget, note)``.

    Raises
    ------
    InputError
        If the weights do not fit, or if too many of the first points failed.
    """
    settings = settings or SurrogateSettings()
    ledger = Ledger(objectives, _no_gradients, dimension, settings.evaluations)
    first = settings.start if settings.evaluations >= 100 else settings.start // 2
    scattered = sobol(dimension, rng)
    _, values = ledger.evaluate(scattered.random(first))
    main = Minima(normalised_weights(weights, values.shape[1]))
    if np.isfinite(main.cost(values)).sum() < 2 * dimension + 2:
        raise InputError.of("search", f"too many of {len(values)} start points failed", "Narrow the bounds")
    history: list[Iteration] = []
    lengths, fitted = None, 0.0
    while True:
        seen = np.isfinite(ledger.values).all(axis=1)
        if seen.sum() >= settings.growth * fitted:
            lengths = fit_lengths(ledger.points[seen], ledger.values[seen], rng, lengths)
            fitted = float(seen.sum())
        assert lengths is not None
        process = GaussianProcess(ledger.points[seen], ledger.values[seen], lengths)
        inner = niching(
            process.mean, process.mean_and_slope, dimension, rng,
            NichingSettings(evaluations=settings.inner, tight=2e-4, compromise=0.0), main.weights,
        )  # fmt: skip
        minima = inner.stored_points
        cost = main.cost(ledger.values)
        history.append(Iteration(ledger.used, float(cost.min()), len(minima), 0.0))
        if progress is not None:
            progress(ledger.used, ledger.budget, f"best {cost.min():.4g}, {len(minima)} minima of the surrogate")
        candidates = scattered.random(256)
        doubt = process.deviation(candidates)
        open_ = minima[~_near(minima, ledger.points, settings.confirmed)]
        if ledger.left == 0 or (len(open_) == 0 and doubt.max() < settings.settled):
            break
        chosen = _chosen(open_, process, main, settings.batch - settings.explore)
        least_known = candidates[np.argsort(-doubt)[: settings.batch - len(chosen)]]
        fresh = np.concatenate([chosen, least_known])
        ledger.evaluate(fresh[~_near(fresh, ledger.points[~seen], settings.claimed)])
    return _result(ledger, main, minima, history, settings)


def _no_gradients(_: Array) -> tuple[Array, Array]:
    raise NotImplementedError("the surrogate search takes no gradients of the objectives")


def _near(points: Array, others: Array, radius: float) -> NDArray[np.bool_]:
    """Which points (N, d) have one of the others within the radius."""
    if len(points) == 0 or len(others) == 0:
        return np.zeros(len(points), dtype=bool)
    gaps = np.linalg.norm(points[:, None] - others[None], axis=-1)
    return np.asarray(gaps.min(axis=1) < radius)


def _chosen(points: Array, process: GaussianProcess, main: Minima, most: int) -> Array:
    """Of the points, turn by turn the one of lowest mean and the one of greatest uncertainty."""
    if len(points) <= most:
        return points
    queues = [list(np.argsort(main.cost(process.mean(points)))), list(np.argsort(-process.deviation(points)))]
    taken: list[int] = []
    while len(taken) < most:
        queue = queues[len(taken) % 2]
        taken.append(next(int(k) for k in queue if k not in taken))
    return points[taken]


def _result(
    ledger: Ledger, main: Minima, minima: Array, history: list[Iteration], settings: SurrogateSettings
) -> SearchResult:
    points, values = ledger.points, ledger.values
    cost = main.cost(values)
    gaps = np.linalg.norm(minima[:, None] - points[None], axis=-1)
    close = [np.flatnonzero(row < settings.claimed) for row in gaps]
    stored = [int(rows[np.argmin(gaps[k][rows])]) for k, rows in enumerate(close) if len(rows)]
    stored = sorted(dict.fromkeys(stored), key=lambda row: float(cost[row]))
    order = np.argsort(cost, kind="stable")[: len(cost) // 2]
    return SearchResult(
        method="surrogate",
        points=points,
        objectives=values,
        cost=cost,
        stored=np.array(stored or [int(np.argmin(cost))], dtype=np.int64),
        swarm=order,
        labels=np.zeros(len(order), dtype=np.int64),
        front=nondominated(values),
        history=tuple(history),
    )
