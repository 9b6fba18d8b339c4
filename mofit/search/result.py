"""What a search hands over: everything it evaluated, and the points worth refining."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import InputError
from mofit.parameters import Array

Indices = NDArray[np.int64]
Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, note)``."""


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
        Number of clusters the swarm was split into during the iteration.
    radius
        Mean cluster radius in the unit cube when these clusters were formed (0 before the first clustering).
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
    method
        Name of the search, e.g. ``"effa"``.
    points
        All evaluated points in order, shape (evaluation, d).
    objectives
        Their objective vectors, shape (evaluation, objective); nan where a simulation failed.
    cost
        Their scalar cost, shape (evaluation,); ``inf`` where a simulation failed.
    stored
        Rows of `points` that were archived as bests of a cluster, in the order of storing, without repeats.
    swarm
        Rows of `points` that hold the final swarm, shape (firefly,).
    labels
        Cluster of each firefly of the final swarm, counted from 0.
    front
        Rows of `points` that no other point dominates (see `nondominated`).
    history
        One entry per iteration, the start first.
    gradients
        How many of the evaluations were with gradient.
    unseen
        Expected number of minima that were not seen (`mofit.search.unseen`); None where the search has no estimate.
    """

    method: str
    points: Array
    objectives: Array
    cost: Array
    stored: Indices
    swarm: Indices
    labels: Indices
    front: Indices
    history: tuple[Iteration, ...]
    gradients: int = 0
    unseen: float | None = None

    @property
    def evaluations(self) -> int:
        """Number of evaluated points."""
        return len(self.points)

    @property
    def best(self) -> int:
        """Row of the point of least cost."""
        return int(np.argmin(self.cost))

    @property
    def stored_points(self) -> Array:
        """Archived cluster bests, shape (stored, d)."""
        return self.points[self.stored]

    @property
    def stored_cost(self) -> Array:
        """Cost of the archived cluster bests, shape (stored,)."""
        return self.cost[self.stored]

    @property
    def fireflies(self) -> Array:
        """Final swarm, shape (firefly, d)."""
        return self.points[self.swarm]


def normalised_weights(weights: ArrayLike | None, count: int) -> Array:
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
