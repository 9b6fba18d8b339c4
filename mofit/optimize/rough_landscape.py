"""Minima of a landscape that gradients do not describe: rounds of CMA-ES from the centres of clusters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mofit._typing import FloatArray
from mofit.errors import check_settings
from mofit.optimize.cma import Runs, adapt, default_population
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.minima_archive import Endpoint, MinimaArchive
from mofit.optimize.swarm import SwarmSettings, cluster_centres


@dataclass(frozen=True)
class RoughSettings:
    """Settings of `search_rough`. Lengths are shares of the box."""

    share: float = 0.5
    """A landscape is rough if more than this share of the descents end where no step along the gradient leads down."""
    least: int = 2000
    """Evaluations left per parameter below which it is not searched: a run takes some hundred per parameter."""
    sample: int = 64
    """Uniform points per parameter in the first round."""
    growth: float = 2.0
    """Of the sample from round to round: what the first rounds have not found is smaller."""
    population_growth: float = 1.05
    """Of the population: larger ones pass over rougher structure (Auger and Hansen 2005), but take longer."""
    neighbours: float = 1.0
    """As in `SwarmSettings`, for the clusters of the sample."""
    best: float = 1.0
    """Better share of the clusters, from which runs start."""
    most: int = 128
    """Runs per round."""
    together: int = 600
    """Points per generation of all runs that go together: one call of the function is then long beside its
    overhead."""
    steps: tuple[float, float] = (0.1, 1.0)
    """Typical first distances of a run's points from its start, in distances between neighbours in the sample, drawn
    between these: a short one stays in a narrow basin, a long one passes over small ones."""
    hopeless: float = 20.0
    """A run that has contracted is given up where so many times the spread of its values does not reach the best."""
    contracted: float = 0.1
    """What contracted means: share of the first standard deviation."""
    known: float = 3.0
    """A run is given up where a known minimum lies within so many standard deviations of it."""
    near: float = 0.05
    """And within this distance; a run at the rim of a basin is wide."""
    attraction: float = 0.4
    """A run is given up within this share of the distance from a known minimum that no run came within and then ended
    elsewhere."""
    merge: float = 1e-3
    """Ends this close are one minimum."""
    equal: float = 1e-6
    """Ends worse than the best by more than this share of the cost's range are no minima."""

    def __post_init__(self) -> None:
        checks = [
            ("share", 0 <= self.share <= 1, "Give a share in [0, 1]"),
            ("least", self.least >= 0, "Give 0 or more"),
            ("sample", self.sample >= 8, "Give at least 8"),
            ("growth", self.growth >= 1, "Give 1 or more"),
            ("population_growth", self.population_growth >= 1, "Give 1 or more"),
            ("best", 0 < self.best <= 1, "Give a share in (0, 1]"),
            ("most", self.most >= 1, "Give at least 1"),
        ]
        check_settings("search", self, checks)


def is_rough(log: EvaluationLog, archive: MinimaArchive, settings: RoughSettings) -> bool:
    """Whether most descents so far ended where the gradient leads nowhere, and the budget allows to go on without."""
    enough = log.left >= settings.least * log.points.shape[1]
    return enough and len(archive.smooth) > 0 and float(np.mean(archive.smooth)) < 1 - settings.share


def search_rough(
    log: EvaluationLog, archive: MinimaArchive, rng: np.random.Generator, settings: RoughSettings, found_by: str
) -> MinimaArchive:
    """Spend the budget on the deepest minima: sample, cluster, CMA-ES from the centres, in rounds that grow.

    A run ends early where it comes to a known minimum, or where it cannot come as deep as the best (hill valleys and
    the time to the optimum decide this in HillVallEA). Local minima that are higher than the best are left out: a rough
    landscape has no end of them.

    Parameters
    ----------
    log
        Evaluates and keeps.
    archive
        What is minimised; its descents' ends are no minima here.
    rng
        Draws samples and populations.
    settings
        Constants.
    found_by
        The stage of the search.

    Returns
    -------
    The minima, in a new archive; the old one if there is none.

    References
    ----------
    Ahrari, Elsayed, Sarker, Essam, Coello Coello, "Static and dynamic multimodal optimization by improved covariance
    matrix self-adaptation evolution strategy with repelling subpopulations", IEEE TEVC 26 (2022).
    Maree, Alderliesten, Bosman, "Benchmarking HillVallEA for the GECCO 2019 competition on multimodal optimization",
    arXiv:1907.10988 (2019).
    """
    d = log.points.shape[1]
    costs = archive.cost(log.values)
    worth = settings.equal * float(np.ptp(costs[np.isfinite(costs)]))
    deepest = _Deepest(d, worth, settings, float(costs.min()))
    short, long = settings.steps
    size, population = float(settings.sample * d), float(default_population(d))

    def evaluate(points: FloatArray) -> FloatArray:
        return archive.cost(log.evaluate(points)[1])

    while log.left > 0:
        before = log.used
        points = rng.random((int(size), d))
        cost = evaluate(points)
        points = points[: len(cost)]
        if len(points) <= d + 1:
            break
        centres, _ = cluster_centres(points, cost, SwarmSettings(neighbours=settings.neighbours))
        centres = centres[~deepest.attracts(points[centres])]
        starts = points[centres[: min(settings.most, max(4, int(settings.best * len(centres))))]]
        spacing = float(np.median(cKDTree(points).query(points, k=min(6, len(points)))[0][:, 1:].mean(axis=1)))
        batch = max(4, min(settings.most, settings.together // int(population)))
        for first in range(0, len(starts), batch):
            if log.left == 0:
                break
            some = starts[first : first + batch]
            steps = spacing / d**0.5 * np.exp(rng.uniform(np.log(short), np.log(long), len(some)))
            deepest.add(adapt(evaluate, some, steps, rng, int(population), deepest.stop))
        if log.used - before > 8 * len(points):
            size *= settings.growth
        population *= settings.population_growth
    return deepest.archive(log, archive, found_by)


def _distances(points: FloatArray, others: FloatArray) -> FloatArray:
    """Between all pairs, shape (n, m)."""
    return np.asarray(cdist(points, others))


class _Deepest:
    """The deepest minima so far, and the paths of the runs that tell how far each of them attracts."""

    def __init__(self, d: int, worth: float, settings: RoughSettings, best: float) -> None:
        self.points, self.cost = np.empty((0, d)), np.empty(0)
        self.radius = np.empty(0)
        """A run that comes this close to a minimum is taken to end there."""
        self.worth, self.best, self.settings = worth, best, settings
        self._means: list[FloatArray] = []
        self._ends = np.empty((0, d))
        self._paths: list[tuple[FloatArray, FloatArray]] = []

    def attracts(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which points lie where a known minimum attracts."""
        if len(self.points) == 0:
            return np.zeros(len(points), dtype=bool)
        return np.asarray(np.any(_distances(points, self.points) < self.radius, axis=1))

    def stop(self, runs: Runs) -> NDArray[np.bool_]:
        """Which runs to give up."""
        s, d = self.settings, self.points.shape[1]
        if not self._means:
            self._ends = np.full_like(runs.mean, np.inf)
        self._means.append(np.where(runs.active[:, None], runs.mean, np.nan))
        best = min(self.best, float(runs.cost.min()))
        contracted = runs.size < s.contracted * runs.first_step
        hopeless = contracted & (s.hopeless * runs.spread < runs.cost - best - self.worth)
        wide = s.known * d**0.5 * runs.size
        reach = np.where(runs.size < 2 * s.contracted * runs.first_step, np.minimum(wide, s.near), 0.0)
        ahead = (runs.cost < runs.cost[:, None]) & (runs.active | runs.converged) & (reach > 0)
        met = np.any(ahead & (_distances(runs.mean, runs.mean) < reach[:, None]), axis=1)
        known = np.zeros_like(met)
        if len(self.points):
            gap = _distances(runs.mean, self.points)
            known = np.any(gap < np.maximum(self.radius, reach[:, None]), axis=1)
            near = self.points[gap.argmin(axis=1)]
            at_known = known | (hopeless & (gap.min(axis=1) < wide))
            ended = runs.active & at_known
            self._ends[ended] = near[ended]
            hopeless_there = hopeless & at_known
        else:
            hopeless_there = np.zeros_like(met)
        lost = runs.active & hopeless & ~known & ~met & ~hopeless_there
        self._ends[lost] = np.nan
        return np.asarray(hopeless | met | known)

    def add(self, runs: Runs) -> None:
        """Add the ends of those that converged, each once."""
        self.best = min(self.best, float(runs.cost.min()))
        points = np.concatenate([self.points, runs.points[runs.converged]])
        cost = np.concatenate([self.cost, runs.cost[runs.converged]])
        kept: list[int] = []
        for k in np.argsort(cost, kind="stable"):
            if cost[k] > self.best + self.worth:
                break
            if all(np.linalg.norm(points[k] - points[j]) > self.settings.merge for j in kept):
                kept.append(int(k))
        self.points, self.cost = points[kept], cost[kept]
        self._ends[runs.converged] = runs.points[runs.converged]
        told = ~np.isinf(self._ends[:, 0])
        if told.any() and self._means:
            self._paths.append((np.array(self._means)[:, told], self._ends[told]))
        self._means = []
        self.radius = self._radii(); import os; os.environ.get("DBG") and print("radii",np.round(self.radius*10,2), "attracted", self.attracts(np.random.default_rng(0).random((1000,self.points.shape[1]))).mean(), np.round(_distances(self.points,self.points)*10,1)[0])

    def _radii(self) -> FloatArray:
        """How close runs came to each minimum that ended elsewhere; a share of that."""
        radii = np.zeros(len(self.points))
        for k, point in enumerate(self.points):
            closest, here = [], 0
            for path, ends in self._paths:
                other = ~(np.linalg.norm(ends - point, axis=1) < self.settings.merge)
                here += np.count_nonzero(~other)
                if other.any():
                    closest.append(np.nanmin(np.linalg.norm(path[:, other] - point, axis=2), axis=0))
            if closest:
                apart = np.sort(np.concatenate(closest))
                radii[k] = self.settings.attraction * apart[min(here // 10, len(apart) - 1)]
        return radii

    def archive(self, log: EvaluationLog, old: MinimaArchive, found_by: str) -> MinimaArchive:
        """As an archive of rows of the log."""
        if len(self.points) == 0:
            return old
        new = MinimaArchive(old.weights)
        rows = cKDTree(log.points).query(self.points)[1]
        for row, point, cost in zip(rows, self.points, self.cost, strict=True):
            new.add(Endpoint(int(row), point, float(cost), np.eye(len(point)), True, found_by))
        return new
