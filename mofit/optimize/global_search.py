"""What a global search is given and what it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError

Indices = NDArray[np.int64]
Objectives = Callable[[FloatArray], FloatArray]
"""Points (N, d) of the unit cube to objective vectors (N, T), to be minimised; nan marks a failure."""
Gradients = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""The same with exact gradients: (N, T) and (N, T, d)."""
Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, note)``."""

#: Stages of a search that tells them apart, the first one first.
STAGES = ("swarm", "completion", "adaptation")


@dataclass(frozen=True)
class Iteration:
    """One line of the history of a search.

    Parameters
    ----------
    evaluations
        Points evaluated so far.
    best
        Smallest cost so far; ``inf`` while every evaluation failed.
    clusters
        Number of clusters of the population, or of minima, at that time.
    radius
        Mean cluster radius in the unit cube (0 before the first clustering), or tabu radius.
    """

    evaluations: int
    best: float
    clusters: int
    radius: float


@dataclass(frozen=True)
class SearchResult:
    """The outcome of a search in the unit cube.

    Parameters
    ----------
    points
        All evaluated points in order, shape (evaluation, d).
    objectives
        Their objective vectors, shape (evaluation, objective); nan where a simulation failed.
    cost
        Their scalar cost, shape (evaluation,); ``inf`` where a simulation failed.
    archived
        Rows of `points` that are archived as minima, or as bests of a cluster, without repeats.
    population
        Rows of `points` that hold the final population, shape (member,).
    labels
        Cluster of each member of the population, counted from 0.
    front
        Rows of `points` that no other point dominates (`mofit.optimize.pareto_front.nondominated`).
    history
        One entry per iteration, the start first.
    gradients
        How many of the evaluations were with gradient.
    expected_undiscovered
        Expected number of undiscovered minima (`mofit.optimize.minima_archive.expected_undiscovered`); None where
        there is no estimate.
    complete
        Whether that number fell below the search's limit before the budget was spent; None where there is no estimate.
    found_by
        Which of the `STAGES` found each archived point; empty where the search has one alone.
    minimises
        The objective that each archived point minimises, counted from 0; -1 for the weighted mean; empty if not known.
    generations
        Rows of `points` that hold the population of every generation, shape (generation, member); empty if not kept.
    generation_labels
        Their clusters, counted from 0, in all generations the same; -1 where the evaluation failed.
    """

    points: FloatArray
    objectives: FloatArray
    cost: FloatArray
    archived: Indices
    population: Indices
    labels: Indices
    front: Indices
    history: tuple[Iteration, ...]
    gradients: int = 0
    expected_undiscovered: float | None = None
    complete: bool | None = None
    found_by: tuple[str, ...] = ()
    minimises: tuple[int, ...] = ()
    generations: Indices = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))
    generation_labels: Indices = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))

    @property
    def evaluations(self) -> int:
        """Number of evaluated points."""
        return len(self.points)

    @property
    def best(self) -> int:
        """Row of the point of least cost."""
        return int(np.argmin(self.cost))

    @property
    def archived_points(self) -> FloatArray:
        """Archived points, shape (archived, d)."""
        return self.points[self.archived]

    @property
    def archived_cost(self) -> FloatArray:
        """Their cost, shape (archived,)."""
        return self.cost[self.archived]

    @property
    def population_points(self) -> FloatArray:
        """Final population, shape (member, d)."""
        return self.points[self.population]


def normalised_weights(weights: ArrayLike | None, count: int) -> FloatArray:
    """Weights of so many objectives, summing to 1; equal if not given.

    Raises
    ------
    InputError
        If there are too many or few, one is negative, or all are zero.
    """
    given = np.ones(count) if weights is None else np.asarray(weights, dtype=float)
    if given.shape != (count,) or not np.all(np.isfinite(given)) or np.any(given < 0) or given.sum() <= 0:
        raise InputError.of(
            "search weights",
            f"{given.tolist()} do not fit {count} objectives",
            "Give one weight per objective, none negative and not all zero",
        )
    return given / given.sum()


def weighted_sum(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Cost of objective vectors (..., T): their weighted sum, infinite where one that carries weight has failed."""
    used = weights > 0
    total = values[..., used] @ weights[used]
    return np.asarray(np.where(np.isfinite(total), total, np.inf))


def only_point(objectives: Objectives, point: FloatArray, weights: ArrayLike | None = None) -> SearchResult:
    """The result of a search that evaluates a single point (d,), which is known to be near the minimum."""
    values = objectives(point[None])
    first = np.zeros(1, dtype=np.int64)
    cost = weighted_sum(values, normalised_weights(weights, values.shape[1]))
    return SearchResult(point[None], values, cost, first, first, first, first, (Iteration(1, float(cost[0]), 1, 0.0),))
