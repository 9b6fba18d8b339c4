"""Minima of a landscape that gradients do not describe: rounds of CMA-ES from the centres of clusters."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mofit._typing import FloatArray
from mofit.errors import check_settings
from mofit.optimize.cma import Runs, adapt, default_population
from mofit.optimize.difference_hops import Hops, HopSettings
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
    sample_share: float = 0.125
    """The sample grows only while it takes less than this share of a round: many runs are worth more."""
    population_growth: float = 1.05
    """Of the population: larger ones pass over rougher structure (Auger and Hansen 2005), but take longer."""
    neighbours: float = 1.0
    """As in `SwarmSettings`, for the clusters of the sample."""
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
    """And where it comes nearer to one than this share of the least distance at which runs passed it: they are told
    early, but not all of them."""
    elsewhere: float = 0.1
    """Runs, as a share of those that ended in a minimum, that may pass it nearer: their ends may be wrong."""
    merge: float = 1e-3
    """Ends this close are one minimum."""
    equal: float = 1e-6
    """Ends worse than the best by more than this share of the cost's range are no minima."""
    hops: HopSettings = field(default_factory=HopSettings)
    """For minima in valleys that samples do not show."""

    def __post_init__(self) -> None:
        checks = [
            ("share", 0 <= self.share <= 1, "Give a share in [0, 1]"),
            ("least", self.least >= 0, "Give 0 or more"),
            ("sample", self.sample >= 8, "Give at least 8"),
            ("growth", self.growth >= 1, "Give 1 or more"),
            ("population_growth", self.population_growth >= 1, "Give 1 or more"),
            ("sample_share", 0 <= self.sample_share <= 1, "Give a share in [0, 1]"),
            ("attraction", 0 <= self.attraction < 1, "Give a share in [0, 1)"),
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

    Between the rounds, it hops by the differences of local minima (`mofit.optimize.difference_hops`). A run ends early
    where it comes to a known minimum, or where it cannot come as deep as the best (hill valleys and the time to the
    optimum decide this in HillVallEA). Local minima that are higher than the best are left out: a rough landscape has
    no end of them.

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
    size, population = float(settings.sample * d), float(default_population(d))

    def evaluate(points: FloatArray) -> FloatArray:
        return archive.cost(log.evaluate(points)[1])

    hops, hopped, idle = Hops(evaluate, d, rng, settings.hops), 0, 0
    begin, patience, dear = log.used, settings.hops.patience * log.left, settings.hops.dear * log.left
    per_run = 0.0
    while log.left > 0:
        before = log.used
        points = rng.random((int(size), d))
        cost = evaluate(points)
        points = points[: len(cost)]
        if len(points) <= d + 1:
            break
        starts, steps = _starts(points, cost, deepest, rng)
        batch = max(4, min(settings.most, settings.together // int(population)))
        for first in range(0, len(starts), batch):
            if log.left == 0:
                break
            some = slice(first, first + batch)
            deepest.add(adapt(evaluate, starts[some], steps[some], rng, int(population), deepest.stop))
        if len(starts):
            per_run = max(per_run, (log.used - before) / len(starts))
        if settings.sample_share * (log.used - before) > len(points):
            size *= settings.growth
        population *= settings.population_growth
        cheap = hops.runs * per_run < dear
        while cheap and log.left > 0 and idle < patience and hopped < settings.hops.share * (log.used - begin):
            before, known = log.used, len(deepest.points)
            starts, steps = hops.round(deepest.best, deepest.points, deepest.attracts)
            if len(starts):
                deepest.add(adapt(evaluate, starts, steps, rng, None, deepest.stop))
            hopped += log.used - before
            idle = 0 if len(deepest.points) > known else idle + log.used - before
    return deepest.archive(log, archive, found_by)


def _starts(
    points: FloatArray, cost: FloatArray, deepest: _Deepest, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Centres of the clusters of a sample that no known minimum attracts, best first, and the first steps there."""
    settings, d = deepest.settings, points.shape[1]
    centres, _ = cluster_centres(points, cost, SwarmSettings(neighbours=settings.neighbours))
    starts = points[centres]
    starts = starts[~deepest.attracts(starts)][: settings.most]
    spacing = float(np.median(cKDTree(points).query(points, k=min(6, len(points)))[0][:, 1:].mean(axis=1)))
    short, long = np.log(settings.steps)
    return starts, spacing / d**0.5 * np.exp(rng.uniform(short, long, len(starts)))


class _Deepest:
    """The deepest minima so far, and the paths of the runs, which tell how far each minimum attracts."""

    def __init__(self, d: int, worth: float, settings: RoughSettings, best: float) -> None:
        self.points, self.cost, self.radii = np.empty((0, d)), np.empty(0), np.empty(0)
        self.worth, self.best, self.settings = worth, best, settings
        self._means: list[FloatArray] = []
        self._ends = np.empty((0, d))
        """Where each of the present runs ended: nan for no minimum, infinite while it is not known."""
        self._paths: list[tuple[FloatArray, FloatArray]] = []
        """Means, shape (generation, run, d), nan when the run was over, and ends of earlier runs."""

    def attracts(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which points lie where a known minimum attracts."""
        return np.asarray(np.any(cdist(points, self.points) < self.radii, axis=1))

    def stop(self, runs: Runs) -> NDArray[np.bool_]:
        """Which runs to give up: they cannot come as deep as the best, or end where a better run or a minimum is."""
        s, d = self.settings, self.points.shape[1]
        if not self._means:
            self._ends = np.full_like(runs.mean, np.inf)
        self._means.append(np.where(runs.active[:, None], runs.mean, np.nan))
        best = min(self.best, float(runs.cost.min()))
        contracted = runs.size < s.contracted * runs.first_step
        hopeless = contracted & (s.hopeless * runs.spread < runs.cost - best - self.worth)
        wide = s.known * d**0.5 * runs.size
        reach = np.where(runs.size < 2 * s.contracted * runs.first_step, np.minimum(wide, s.near), 0.0)
        better = (runs.cost < runs.cost[:, None]) & (runs.active | runs.converged) & (reach > 0)
        met = np.any(better & (cdist(runs.mean, runs.mean) < reach[:, None]), axis=1)
        self._ends[runs.active & hopeless & ~met] = np.nan
        if len(self.points) == 0:
            return np.asarray(hopeless | met)
        gap = cdist(runs.mean, self.points)
        known = np.any(gap < np.maximum(self.radii, reach[:, None]), axis=1)
        there = runs.active & (known | (hopeless & (gap.min(axis=1) < wide)))
        self._ends[there] = self.points[gap.argmin(axis=1)[there]]
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
        if self._means:
            self._ends[runs.converged] = runs.points[runs.converged]
            told = ~np.isinf(self._ends[:, 0])
            self._paths.append((np.array(self._means)[:, told], self._ends[told]))
            self._means = []
        self.radii = np.array([self._radius(point) for point in self.points])

    def _radius(self, point: FloatArray) -> float:
        """Distance from a minimum within which a run is taken to end there; 0 if none ended elsewhere."""
        closest, here = [np.empty(0)], 0
        for path, ends in self._paths:
            other = ~(np.linalg.norm(ends - point, axis=1) < self.settings.merge)
            here += int(np.count_nonzero(~other))
            if other.any():
                closest.append(np.nanmin(np.linalg.norm(path[:, other] - point, axis=2), axis=0))
        apart = np.sort(np.concatenate(closest))
        few = min(int(self.settings.elsewhere * here), len(apart) - 1)
        return self.settings.attraction * float(apart[few]) if len(apart) else 0.0

    def archive(self, log: EvaluationLog, old: MinimaArchive, found_by: str) -> MinimaArchive:
        """As an archive of rows of the log."""
        if len(self.points) == 0:
            return old
        new = MinimaArchive(old.weights)
        rows = cKDTree(log.points).query(self.points)[1]
        for row, point, cost in zip(rows, self.points, self.cost, strict=True):
            new.add(Endpoint(int(row), point, float(cost), np.eye(len(point)), True, found_by))
        return new
