"""The enhanced firefly algorithm (eFFA): a swarm that splits into clusters and stores their bests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import InputError, check_settings
from mofit.parameters import Array
from mofit.search.clusters import Clustering, cluster, one_cluster
from mofit.search.front import nondominated
from mofit.search.ledger import Objectives
from mofit.search.result import Indices, Iteration, Progress, SearchResult, normalised_weights
from mofit.sobol import sobol


@dataclass(frozen=True)
class EffaSettings:
    """Settings of `effa`; the paper is Hackl et al. (2016), section "Rastrigin function" unless said otherwise."""

    fireflies: int = 25
    """m of the paper."""
    iterations: int = 24
    """it_max of the paper."""
    epoch: int = 4
    """n of the paper: iterations between two clusterings, and before the first."""
    gamma: float = 0.75
    """Light absorption per unit-cube distance: the paper's 0.75 / (sqrt(L) |b|), read in coordinates scaled by L."""
    beta: float = 1.0
    """Attractiveness at distance 0. The paper says O(1); 1 is Yang's (2010) usual choice."""
    alpha: float = 0.75
    """Width of the first random step in unit-cube lengths: 0.75 L of the paper."""
    delta: float = 0.9
    """Randomness reduction per iteration, from the paper."""
    mend_best: bool = True
    """The best of a cluster makes a random trial move and keeps it if better. In the paper it stands still, so that a
    lone firefly is stored where it happened to be (its x_bad); the paper announces to change this."""
    start: Literal["sobol", "uniform"] = "sobol"
    """First swarm: scrambled Sobol points fill the box evenly; the paper draws uniformly."""

    def __post_init__(self) -> None:
        checks = [
            ("fireflies", self.fireflies >= 2, "Give at least 2"),
            ("iterations", self.iterations >= 0, "Give 0 or more"),
            ("epoch", self.epoch >= 1, "Give at least 1"),
            ("gamma", self.gamma >= 0, "Give 0 or more"),
            ("beta", 0 < self.beta <= 2, "Give a value in (0, 2]"),
            ("alpha", self.alpha >= 0, "Give 0 or more"),
            ("delta", 0 < self.delta <= 1, "Give a value in (0, 1]"),
            ("start", self.start in ("sobol", "uniform"), "Use 'sobol' or 'uniform'"),
        ]
        check_settings("search", self, checks)


PAPER = EffaSettings(mend_best=False, start="uniform")
"""The algorithm of the paper exactly."""


@dataclass(frozen=True)
class _Swarm:
    """Fireflies and everything evaluated so far; `rows` are the fireflies' rows in `points`."""

    points: Array
    objectives: Array
    cost: Array
    rows: Indices

    @property
    def positions(self) -> Array:
        return self.points[self.rows]

    @property
    def values(self) -> Array:
        return self.cost[self.rows]


def effa(
    objectives: Objectives,
    dimension: int,
    rng: np.random.Generator,
    settings: EffaSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    r"""Enhanced firefly algorithm on the weighted mean of an objective vector.

    In every iteration, firefly i moves towards each brighter firefly j of its cluster, the brightest first,

    .. math:: x_i \leftarrow x_i + \beta e^{-\gamma |x_i - x_j|} (x_j - x_i) + \alpha \delta^t (\epsilon - 1/2),

    with :math:`x_j` where it was when the iteration began and :math:`\epsilon` uniform in the unit cube, and is then
    clipped to the box; the moved fireflies are evaluated in one call. After every `epoch` iterations the best of each
    cluster is stored and the whole swarm clustered anew (see `cluster`); the bests of the last clusters are stored too.

    Parameters
    ----------
    objectives
        Maps points (N, d) of the unit cube to objective vectors (N, T), to be minimised. A nan marks a failure: such a
        point is worse than any other and attracts nobody.
    dimension
        Number of coordinates d.
    rng
        The only source of randomness.
    settings
        Constants of the algorithm; `PAPER` is the paper's version.
    weights
        Weights of the objectives, shape (T,), none negative; equal if not given. Brightness is the weighted mean.
    progress
        Called as ``progress(iteration, iterations, note)``.

    Raises
    ------
    InputError
        If the weights do not fit, or if every point of the first swarm failed.

    References
    ----------
    Hackl, Hirschberg, Lex, Magele: Parametrisation of a Maxwell model for transient tyre forces by means of an
    extended firefly algorithm (2016), Algorithm 1 and equations (13)-(15).
    """
    settings = settings or EffaSettings()
    start = _first_positions(dimension, rng, settings)
    values = _evaluated(objectives, start)
    weights = normalised_weights(weights, values.shape[1])
    swarm = _Swarm(start, values, weighted_mean(values, weights), np.arange(len(start)))
    if not np.isfinite(swarm.cost).any():
        raise InputError.of("search", f"all {len(start)} start points failed", "Check the model, or narrow the bounds")

    clustering = one_cluster(settings.fireflies)
    stored: list[int] = []
    history = [_line(swarm, clustering)]
    for t in range(settings.iterations):
        swarm = _iterate(swarm, clustering, settings.alpha * settings.delta**t, objectives, weights, rng, settings)
        history.append(_line(swarm, clustering))
        if (t + 1) % settings.epoch == 0:
            if t + 1 > settings.epoch:
                stored.extend(_cluster_bests(swarm, clustering))
            clustering = cluster(swarm.positions)
        if progress is not None:
            progress(t + 1, settings.iterations, f"best {history[-1].best:.4g}, {clustering.count} clusters")
    stored.extend(_cluster_bests(swarm, clustering))

    return SearchResult(
        method="effa",
        points=swarm.points,
        objectives=swarm.objectives,
        cost=swarm.cost,
        stored=np.array(list(dict.fromkeys(stored)), dtype=np.int64),
        swarm=swarm.rows,
        labels=clustering.labels,
        front=nondominated(swarm.objectives),
        history=tuple(history),
    )


def weighted_mean(objectives: Array, weights: Array) -> Array:
    """Cost of each row: its weighted mean, ``inf`` where an objective that carries weight is not finite."""
    used = weights > 0
    mean = np.asarray(objectives[:, used] @ weights[used])
    return np.where(np.isfinite(mean), mean, np.inf)


def _first_positions(dimension: int, rng: np.random.Generator, settings: EffaSettings) -> Array:
    if settings.start == "uniform":
        return rng.random((settings.fireflies, dimension))
    return sobol(dimension, rng).random(1 << (settings.fireflies - 1).bit_length())[: settings.fireflies]


def _evaluated(objectives: Objectives, points: Array) -> Array:
    values = np.asarray(objectives(points), dtype=float)
    if values.ndim != 2 or len(values) != len(points):
        raise ValueError(f"objectives must return ({len(points)}, T), got {values.shape}")
    return values


def _iterate(
    swarm: _Swarm,
    clustering: Clustering,
    width: float,
    objectives: Objectives,
    weights: Array,
    rng: np.random.Generator,
    settings: EffaSettings,
) -> _Swarm:
    """Move the swarm once and evaluate those that moved."""
    moved, is_best = _moves(swarm, clustering.labels, width, rng, settings)
    if settings.mend_best:
        trial = swarm.positions + width * (rng.random(swarm.positions.shape) - 0.5)
        moved = np.where(is_best[:, None], np.clip(trial, 0.0, 1.0), moved)
        going = np.arange(len(moved))
    else:
        going = np.flatnonzero(~is_best)
    if going.size == 0:
        return swarm

    values = _evaluated(objectives, moved[going])
    cost = weighted_mean(values, weights)
    fresh = len(swarm.points) + np.arange(len(going))
    stays = is_best[going] & ~(cost < swarm.values[going])
    rows = swarm.rows.copy()
    rows[going] = np.where(stays, rows[going], fresh)
    return _Swarm(
        points=np.concatenate([swarm.points, moved[going]]),
        objectives=np.concatenate([swarm.objectives, values]),
        cost=np.concatenate([swarm.cost, cost]),
        rows=rows,
    )


def _moves(
    swarm: _Swarm, labels: Indices, width: float, rng: np.random.Generator, settings: EffaSettings
) -> tuple[Array, NDArray[np.bool_]]:
    """New positions of all fireflies, and which of them saw none brighter in their cluster."""
    old, cost = swarm.positions, swarm.values
    by_brightness = np.argsort(cost, kind="stable")
    new = old.copy()
    is_best = np.ones(len(old), dtype=bool)
    for j in by_brightness:  # all fireflies follow the brightest first, each within its own cluster
        follows = (labels == labels[j]) & (cost > cost[j])
        is_best &= ~follows
        gap = old[j] - new[follows]
        pull = settings.beta * np.exp(-settings.gamma * np.linalg.norm(gap, axis=1, keepdims=True))
        new[follows] += pull * gap + width * (rng.random(gap.shape) - 0.5)
    return np.clip(new, 0.0, 1.0), is_best


def _cluster_bests(swarm: _Swarm, clustering: Clustering) -> list[int]:
    """Row of the best firefly of each cluster; clusters in which all failed have none."""
    bests = []
    for label in range(clustering.count):
        members = np.flatnonzero(clustering.labels == label)
        best = members[np.argmin(swarm.values[members])]
        if np.isfinite(swarm.values[best]):
            bests.append(int(swarm.rows[best]))
    return bests


def _line(swarm: _Swarm, clustering: Clustering) -> Iteration:
    return Iteration(len(swarm.points), float(swarm.cost.min()), clustering.count, clustering.radius)
