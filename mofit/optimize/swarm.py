"""The fireflies of the enhanced firefly algorithm: they fly to the centres of their clusters, each as it sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mofit._typing import FloatArray
from mofit.errors import check_settings
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.global_search import Indices, weighted_sum


@dataclass(frozen=True)
class SwarmSettings:
    """Settings of `fly`; ``scripts/studies/swarm.py`` chose those without another source."""

    share: float = 0.5
    """Of the budget for minima of the mean, for all generations together; the number of fireflies is the next lower
    power of 2, which fills the box evenly."""
    candidates: int = 3
    """Points of the sample per firefly: of them it starts from the brightest, as it sees them, that no other took."""
    moves: int = 2
    """Generations after the first."""
    most: int = 64
    """Fireflies: in large budgets the points of the completion do more."""
    joint: float = 1 / 3
    """Of several objectives, share of the fireflies that see the weighted mean; half of the others see one each, the
    other half weights drawn at random."""
    neighbours: float = 1.0
    """A point is the centre of a cluster if none of so many times ln n nearest of n points is brighter."""
    gamma: float = 0.75
    """Light absorption per unit-cube distance, as in Hackl et al. (2016)."""
    beta: float = 1.0
    """Attractiveness at distance 0, as there."""
    alpha: float = 0.5
    """Half the width of the first random step, in distances to the farthest of those neighbours."""
    delta: float = 0.9
    """Reduction of the random step per generation, as in Hackl et al. (2016)."""

    def __post_init__(self) -> None:
        checks = [
            ("share", 0 < self.share <= 1, "Give a share in (0, 1]"),
            ("candidates", self.candidates >= 1, "Give at least 1"),
            ("moves", self.moves >= 0, "Give 0 or more"),
            ("most", self.most >= 2, "Give at least 2"),
            ("joint", 0 <= self.joint <= 1, "Give a share in [0, 1]"),
            ("neighbours", self.neighbours > 0, "Give a number above 0"),
            ("gamma", self.gamma >= 0, "Give 0 or more"),
            ("beta", 0 < self.beta <= 2, "Give a value in (0, 2]"),
            ("alpha", self.alpha >= 0, "Give 0 or more"),
            ("delta", 0 < self.delta <= 1, "Give a value in (0, 1]"),
        ]
        check_settings("search", self, checks)

    def fireflies(self, budget: int) -> int:
        """How many, for a budget of so many evaluations."""
        return 2 ** int(np.log2(min(max(self.share * budget / (self.candidates + self.moves), 2), self.most)))


@dataclass(frozen=True)
class Swarm:
    """What the fireflies did.

    Parameters
    ----------
    sample
        Rows of the evaluation log among which the fireflies started.
    generations
        Rows of theirs, shape (generation, firefly).
    directions
        Weights of the objectives by which each firefly sees brightness, shape (firefly, objective).
    """

    sample: Indices
    generations: Indices
    directions: FloatArray

    @property
    def rows(self) -> Indices:
        """Rows of all points that the swarm evaluated, ascending."""
        return np.union1d(self.sample, self.generations)


def fly(
    log: EvaluationLog, sample: Indices, weights: FloatArray, rng: np.random.Generator, settings: SwarmSettings
) -> Swarm:
    r"""Move the fireflies for some generations; all points that they evaluate are kept in the log.

    A firefly sees the brightness of a point in its own direction :math:`\lambda_i`, the weighted sum of the objectives,
    so that the swarm holds the minima of single objectives, compromises and the joint minimum at once. It flies towards
    the centre :math:`x_c` of its cluster (`cluster_centres` of all points so far, as it sees them),

    .. math:: x_i \leftarrow x_i + \beta e^{-\gamma |x_i - x_c|} (x_c - x_i) + \alpha \delta^t r_i (2 \epsilon - 1),

    with :math:`r_i` the distance to the farthest of its neighbours and :math:`\epsilon` uniform in the unit cube. The
    centre of a cluster makes the random step alone.

    Parameters
    ----------
    log
        Evaluates and keeps; a generation that the budget does not allow is left out.
    sample
        Rows among which the fireflies start.
    weights
        Of the objectives in their mean, shape (T,).
    rng
        Draws directions and steps.
    settings
        Constants.

    References
    ----------
    Hackl, Hirschberg, Lex, Magele (2016), Algorithm 1, where the brighter fireflies of the cluster attract in turn.
    """
    directions = _directions(max(1, len(sample) // settings.candidates), weights, rng, settings.joint)
    generations = [_brightest(sample, log.values[sample], directions)]
    for move in range(settings.moves):
        if log.left < len(directions):
            break
        points, values, here = log.points, log.values, generations[-1]
        distance, near = _neighbours(points, settings)
        target = here.copy()
        for direction in np.unique(directions, axis=0):
            sees = np.flatnonzero(np.all(directions == direction, axis=1))
            centres, labels = _linked(near, weighted_sum(values, direction))
            own = labels[here[sees]]
            target[sees[own >= 0]] = centres[own[own >= 0]]
        gap = points[target] - points[here]
        attraction = settings.beta * np.exp(-settings.gamma * np.linalg.norm(gap, axis=1, keepdims=True))
        width = settings.alpha * settings.delta**move * distance[here, -1:]
        step = width * (2 * rng.random(gap.shape) - 1)
        moved, _ = log.evaluate(np.clip(points[here] + attraction * gap + step, 0.0, 1.0))
        generations.append(moved)
    return Swarm(sample, np.stack(generations), directions)


def cluster_centres(points: FloatArray, cost: FloatArray, settings: SwarmSettings) -> tuple[Indices, Indices]:
    """Clusters by nearest-better linkage: every point belongs to that of the nearest brighter of its neighbours.

    Parameters
    ----------
    points, cost
        Shapes (n, d) and (n,); where the cost is infinite, a point is no centre and has no label (-1).
    settings
        Number of neighbours.

    Returns
    -------
    Centres, best first, shape (c,), and the cluster of each point as a place among them, shape (n,).

    References
    ----------
    Preuss, "Improved topological niching for real-valued global optimization", EvoApplications 2012.
    """
    return _linked(_neighbours(points, settings)[1], cost)


def _brightest(sample: Indices, values: FloatArray, directions: FloatArray) -> Indices:
    """Of the sample, the brightest point that is not yet taken, for one direction after the other."""
    taken = np.zeros(len(sample), dtype=bool)
    chosen = np.empty(len(directions), dtype=np.int64)
    for firefly, direction in enumerate(directions):
        free = np.flatnonzero(~taken)
        chosen[firefly] = free[np.argmin(weighted_sum(values[free], direction))]
        taken[chosen[firefly]] = True
    return sample[chosen]


def _neighbours(points: FloatArray, settings: SwarmSettings) -> tuple[FloatArray, Indices]:
    """Distances and rows of the nearest neighbours of each point, shapes (n, k)."""
    count = min(len(points) - 1, max(2, round(settings.neighbours * np.log(len(points)))))
    distance, near = cKDTree(points).query(points, k=count + 1)
    return distance[:, 1:], near[:, 1:]


def _linked(near: Indices, cost: FloatArray) -> tuple[Indices, Indices]:
    """Centres and labels from the neighbours of each point, nearest first."""
    everyone = np.arange(len(cost))
    bright = cost[near] < cost[:, None]
    parent = np.where(bright.any(axis=1), near[everyone, np.argmax(bright, axis=1)], everyone)
    while not np.array_equal(parent, parent[parent]):
        parent = parent[parent]
    centres = np.flatnonzero((parent == everyone) & np.isfinite(cost))
    centres = centres[np.argsort(cost[centres], kind="stable")]
    place = np.full(len(cost), -1)
    place[centres] = np.arange(len(centres))
    return centres, place[parent]


def _directions(count: int, weights: FloatArray, rng: np.random.Generator, joint: float) -> FloatArray:
    """The objectives' weights by which each firefly sees brightness; which one sees what follows from its number."""
    objectives = len(weights)
    directions = np.tile(weights, (count, 1))
    if objectives > 1:
        own = np.flatnonzero((np.arange(1, count + 1) * (1 - joint)) % 1 < (1 - joint) - 1e-9)
        single, between = own[::2], own[1::2]
        directions[single] = np.eye(objectives)[np.arange(len(single)) % objectives]
        directions[between] = rng.dirichlet(np.ones(objectives), len(between))
    return directions
