"""Hops by the differences between local minima, which in a periodic landscape lead from one minimum to others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mofit._typing import FloatArray
from mofit.errors import check_settings
from mofit.optimize.cma import Runs, adapt


@dataclass(frozen=True)
class HopSettings:
    """Settings of `Hops`. Lengths are shares of the box."""

    share: float = 0.5
    """Of the evaluations: as many as for the runs between."""
    patience: float = 0.2
    """Of the evaluations, on hops that find no new minimum, after which there are no more: few landscapes repeat."""
    dear: float = 0.2
    """Of the evaluations: there are no hops where a round costs more, as with many parameters."""
    starts: int = 16
    """Short runs per parameter in a round: they show where the local minima are deep."""
    sites: int = 4
    """Places per round from which to hop: the deepest among their neighbours."""
    neighbours: int = 2
    """Than so many neighbours, beside one per parameter, a site is deeper."""
    members: int = 6
    """Local minima per parameter whose differences are tried."""
    most: int = 40
    """Members at most: their first runs are what hops cost."""
    steps: tuple[float, float] = (1e-3, 1e-2)
    """First distances of a short run's points from its start, drawn between these: longer ones leave narrow basins."""
    around: tuple[float, float] = (5e-3, 5e-2)
    """Distances of the first members from their site, drawn between these."""
    narrow: float = 0.1
    """First distances of a member's points from its start, in distances from the site."""
    polish: float = 0.03
    """First distances when members are polished, in distances to the next member: errors add up from hop to hop."""
    contracted: float = 0.1
    """A short run ends when it has contracted to this share of its first distances,"""
    precise: float = 50.0
    """And so many times the spread of its values does not reach the best."""
    merge: float = 1e-3
    """Members this close are one."""

    def __post_init__(self) -> None:
        checks = [
            ("share", 0 <= self.share < 1, "Give a share in [0, 1)"),
            ("dear", 0 <= self.dear <= 1, "Give a share in [0, 1]"),
            ("starts", self.starts >= 1, "Give at least 1"),
            ("sites", self.sites >= 1, "Give at least 1"),
            ("members", self.members >= 1, "Give at least 1"),
            ("most", self.most >= 3, "Give at least 3"),
        ]
        check_settings("search", self, checks)


class Hops:
    """Short runs all over the box, and chains of hops from where they end deepest.

    A landscape of many narrow minima in wide valleys hides its valleys from samples, whose values tell little of the
    minima, and from runs, which wide steps carry away. Where the minima lie periodically, the difference between two
    leads from a third to a fourth: one evaluation in the place of a run.

    Parameters
    ----------
    evaluate
        Points (N, d) to costs; fewer where the budget ends.
    d
        Parameters.
    rng
        Draws starts and populations.
    settings
        Constants.

    References
    ----------
    Storn, Price, "Differential evolution", Journal of Global Optimization 11 (1997).
    """

    def __init__(
        self,
        evaluate: Callable[[FloatArray], FloatArray],
        d: int,
        rng: np.random.Generator,
        settings: HopSettings,
    ) -> None:
        self.evaluate, self.rng, self.settings = evaluate, rng, settings
        self.members = max(3, min(settings.members * d, settings.most))
        self.points, self.cost, self.tried = np.empty((0, d)), np.empty(0), np.empty(0, dtype=bool)
        self._bottoms, self._widths = np.empty((0, d)), np.empty(0)
        """Where chains ended, and how far away they began."""
        self._attracted = np.empty(0, dtype=bool)
        """Whether a known minimum attracted them."""

    @property
    def runs(self) -> int:
        """Runs in a round."""
        return self.settings.starts * self.points.shape[1] + self.settings.sites * self.members

    def round(
        self, best: float, minima: FloatArray, attracts: Callable[[FloatArray], NDArray[np.bool_]]
    ) -> tuple[FloatArray, FloatArray]:
        """Deepest points of chains from new sites, and first steps for runs there.

        Parameters
        ----------
        best
            Lowest cost known.
        minima
            Known ones: what is nearer to one than where a chain to it began lies in its valley, and is no site.
        attracts
            Which points lie where a known minimum attracts: they are no sites either.
        """
        s, d = self.settings, self.points.shape[1]
        starts = self.rng.random((s.starts * d, d))
        points, cost = self._runs(starts, self._between(s.steps, len(starts)), best)
        self.points, self.cost = np.concatenate([self.points, points]), np.concatenate([self.cost, cost])
        self.tried = np.concatenate([self.tried, np.zeros(len(points), dtype=bool)])
        around = cKDTree(self.points).query(self.points, k=1 + d + s.neighbours)[1][:, 1:]
        deep = np.all(self.cost[:, None] <= self.cost[np.minimum(around, len(self.cost) - 1)], axis=1)
        led = self._attracted | np.any(cdist(self._bottoms, minima) < s.merge, axis=1)
        valley = np.any(cdist(self.points, self._bottoms[led]) < self._widths[led], axis=1)
        sites = np.flatnonzero(deep & ~self.tried & ~valley & ~attracts(self.points))
        sites = sites[np.argsort(self.cost[sites], kind="stable")][: s.sites]
        self.tried[sites] = True
        chains = [(k, self._chain(self.points[k], best, attracts)) for k in sites]
        ends = [(k, *end) for k, end in chains if end is not None]
        bottoms, steps = np.array([end[1] for end in ends]).reshape(-1, d), np.array([end[2] for end in ends])
        began = self.points[[end[0] for end in ends]]
        self._bottoms = np.concatenate([self._bottoms, bottoms])
        self._widths = np.concatenate([self._widths, np.linalg.norm(bottoms - began, axis=1)])
        self._attracted = np.concatenate([self._attracted, steps == 0])
        return bottoms[steps > 0], steps[steps > 0]

    def _chain(
        self, site: FloatArray, best: float, attracts: Callable[[FloatArray], NDArray[np.bool_]]
    ) -> tuple[FloatArray, float] | None:
        """Where hops from a site end, and the first step of a run there: 0 if a known minimum attracts it."""
        s, d = self.settings, len(site)
        ways = self.rng.standard_normal((self.members, d))
        far = self._between(s.around, self.members)
        starts = site + (far / np.linalg.norm(ways, axis=1))[:, None] * ways
        points, cost = self._lowest(*self._runs(np.clip(starts, 0, 1), s.narrow * far / d**0.5, best))
        while len(points) > 2:
            before = cost[0]
            points, cost = self._hop(points, cost)
            if attracts(points[:1])[0]:
                return points[0], 0.0
            steps = s.polish / d**0.5 * cKDTree(points).query(points, k=2)[0][:, 1]
            if not cost[0] < before:
                return points[0], float(steps[0])
            better, lower = self._runs(points, steps, best)
            points, cost = self._lowest(np.concatenate([points, better]), np.concatenate([cost, lower]))
        return None

    def _hop(self, points: FloatArray, cost: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Go on from the lowest by all differences, as long as one leads lower."""
        while True:
            best = cost[0]
            trials = (points[0] + points[:, None] - points)[~np.eye(len(points), dtype=bool)]
            trials = trials[np.all((trials >= 0) & (trials <= 1), axis=1)]
            found = self.evaluate(trials)
            points, cost = self._lowest(np.concatenate([points, trials[: len(found)]]), np.concatenate([cost, found]))
            if not cost[0] < best or len(found) < len(trials):
                return points, cost

    def _runs(self, starts: FloatArray, steps: FloatArray, best: float) -> tuple[FloatArray, FloatArray]:
        """Ends of short runs."""
        s = self.settings

        def stop(runs: Runs) -> NDArray[np.bool_]:
            return np.asarray(
                (runs.size < s.contracted * runs.first_step) & (s.precise * runs.spread < runs.cost - best)
            )

        runs = adapt(self.evaluate, starts, steps, self.rng, None, stop)
        known = np.isfinite(runs.cost)
        return runs.points[known], runs.cost[known]

    def _lowest(self, points: FloatArray, cost: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The lowest that are apart, best first."""
        kept: list[int] = []
        for k in np.argsort(cost, kind="stable"):
            if not kept or np.linalg.norm(points[kept] - points[k], axis=1).min() > self.settings.merge:
                kept.append(int(k))
                if len(kept) == self.members:
                    break
        return points[kept], cost[kept]

    def _between(self, ends: tuple[float, float], count: int) -> FloatArray:
        """Lengths, evenly distributed in their logarithm."""
        short, long = np.log(ends)
        return np.asarray(np.exp(self.rng.uniform(short, long, count)))
