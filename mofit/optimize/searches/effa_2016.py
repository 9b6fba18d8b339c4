"""The enhanced firefly algorithm exactly as published: a population that splits into clusters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError, check_settings
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.global_search import (
    Gradients,
    Indices,
    Iteration,
    Objectives,
    Progress,
    SearchResult,
    normalised_weights,
    weighted_sum,
)
from mofit.optimize.pareto_front import nondominated
from mofit.optimize.population_clusters import Clustering, cluster, one_cluster


@dataclass(frozen=True)
class EffaSettings:
    """Settings of `search`, those of Hackl et al. (2016), section "Rastrigin function", where nothing else is named."""

    members: int = 25
    """m of the paper: fireflies."""
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
    """Randomness reduction per iteration."""

    def __post_init__(self) -> None:
        checks = [
            ("members", self.members >= 2, "Give at least 2"),
            ("iterations", self.iterations >= 0, "Give 0 or more"),
            ("epoch", self.epoch >= 1, "Give at least 1"),
            ("gamma", self.gamma >= 0, "Give 0 or more"),
            ("beta", 0 < self.beta <= 2, "Give a value in (0, 2]"),
            ("alpha", self.alpha >= 0, "Give 0 or more"),
            ("delta", 0 < self.delta <= 1, "Give a value in (0, 1]"),
        ]
        check_settings("search", self, checks)


def with_budget(evaluations: int) -> EffaSettings:
    """The settings with as many iterations as a budget allows: every one evaluates all fireflies."""
    default = EffaSettings()
    return replace(default, iterations=max(evaluations // default.members - 1, 0))


def search(
    objectives: Objectives,
    gradients: Gradients,
    dimension: int,
    rng: np.random.Generator,
    settings: EffaSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    r"""Enhanced firefly algorithm (eFFA) on the weighted mean of an objective vector.

    In every iteration, firefly i moves towards each brighter firefly j of its cluster, the brightest first,

    .. math:: x_i \leftarrow x_i + \beta e^{-\gamma |x_i - x_j|} (x_j - x_i) + \alpha \delta^t (\epsilon - 1/2),

    with :math:`x_j` where it was when the iteration began and :math:`\epsilon` uniform in the unit cube, and is then
    clipped to the box; the best of a cluster does not move. The moved fireflies are evaluated in one call. After every
    `epoch` iterations the best of each cluster is archived and the whole population clustered anew (`cluster`); the
    bests of the last clusters are archived too.

    Parameters
    ----------
    objectives
        Maps points (N, d) of the unit cube to objective vectors (N, T), to be minimised. A nan marks a failure: such a
        point is worse than any other and attracts nobody.
    gradients
        Not used.
    dimension, rng, settings, progress
        Number of coordinates d, the only source of randomness, constants, and a callback
        ``progress(iteration, iterations, note)``.
    weights
        Weights of the objectives, shape (T,), none negative; equal if not given. Brightness is the weighted mean.

    Raises
    ------
    InputError
        If the weights do not fit, or if every point of the first population failed.

    References
    ----------
    Hackl, Hirschberg, Lex, Magele: Parametrisation of a Maxwell model for transient tyre forces by means of an
    extended firefly algorithm (2016), Algorithm 1 and equations (13)-(15).
    """
    settings = settings or EffaSettings()
    log = EvaluationLog(objectives, gradients, dimension, settings.members * (settings.iterations + 1))
    rows, values = log.evaluate(rng.random((settings.members, dimension)))
    weights = normalised_weights(weights, values.shape[1])
    cost = weighted_sum(values, weights)
    if not np.isfinite(cost).any():
        raise InputError.of("search", f"all {len(rows)} start points failed", "Check the model, or narrow the bounds")

    clustering = one_cluster(settings.members)
    archived: list[int] = []
    history = [Iteration(log.used, float(cost.min()), clustering.count, clustering.radius)]
    for t in range(settings.iterations):
        moved, best = _moved(
            log.points[rows], cost, clustering.labels, settings.alpha * settings.delta**t, rng, settings
        )
        if not best.all():
            rows[~best], values = log.evaluate(moved[~best])
            cost[~best] = weighted_sum(values, weights)
        lowest = float(weighted_sum(log.values, weights).min())
        history.append(Iteration(log.used, lowest, clustering.count, clustering.radius))
        if (t + 1) % settings.epoch == 0:
            if t + 1 > settings.epoch:
                archived.extend(_cluster_bests(rows, cost, clustering))
            clustering = cluster(log.points[rows])
        if progress is not None:
            progress(t + 1, settings.iterations, f"best {lowest:.4g}, {clustering.count} clusters")
    archived.extend(_cluster_bests(rows, cost, clustering))

    return SearchResult(
        points=log.points,
        objectives=log.values,
        cost=weighted_sum(log.values, weights),
        archived=np.array(list(dict.fromkeys(archived)), dtype=np.int64),
        population=rows,
        labels=clustering.labels,
        front=nondominated(log.values),
        history=tuple(history),
    )


def _moved(
    old: FloatArray, cost: FloatArray, labels: Indices, width: float, rng: np.random.Generator, settings: EffaSettings
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """New positions of all fireflies, and which of them are the brightest of their cluster."""
    new = old.copy()
    is_best = np.ones(len(old), dtype=bool)
    for j in np.argsort(cost, kind="stable"):  # all follow the brightest first, each within its own cluster
        follows = (labels == labels[j]) & (cost > cost[j])
        is_best &= ~follows
        gap = old[j] - new[follows]
        attraction = settings.beta * np.exp(-settings.gamma * np.linalg.norm(gap, axis=1, keepdims=True))
        new[follows] += attraction * gap + width * (rng.random(gap.shape) - 0.5)
    return np.clip(new, 0.0, 1.0), is_best


def _cluster_bests(rows: Indices, cost: FloatArray, clustering: Clustering) -> list[int]:
    """Row of the best firefly of each cluster; clusters in which all failed have none."""
    bests = []
    for label in range(clustering.count):
        members = np.flatnonzero(clustering.labels == label)
        best = members[np.argmin(cost[members])]
        if np.isfinite(cost[best]):
            bests.append(int(rows[best]))
    return bests
