"""Multi-level single linkage: which points of a sample start a descent, and when few minima are left undiscovered."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.optimize.bfgs import DescentSettings, descend
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.global_search import (
    Gradients,
    Indices,
    Iteration,
    Objectives,
    Progress,
    SearchResult,
    normalised_weights,
)
from mofit.optimize.linkage import linked_starts
from mofit.optimize.minima_archive import Endpoint, MinimaArchive, add_if_new, expected_undiscovered, in_known_basin
from mofit.optimize.mlsl_settings import MlslSettings
from mofit.optimize.pareto_front import fill_front, nondominated


class SingleLinkage:
    """A search for the minima of the weighted mean, of each objective, and for the front, stage by stage.

    The caller runs the stages: `draw` Sobol points, `descend` from the points that single linkage chooses, `complete`
    until few minima are left undiscovered, `finish`.

    Parameters
    ----------
    objectives, gradients, dimension, rng, weights, progress
        As in `mofit.optimize.searches.mlsl.search`.
    settings
        Constants.
    """

    def __init__(
        self,
        objectives: Objectives,
        gradients: Gradients,
        dimension: int,
        rng: np.random.Generator,
        settings: MlslSettings,
        weights: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> None:
        from scipy.stats import qmc  # late: its import takes half a second

        self.settings = settings
        self.log = EvaluationLog(objectives, gradients, dimension, settings.evaluations, settings.gradient_cost)
        self.sample: Indices = np.empty(0, dtype=np.int64)
        """Rows of the Sobol points, from which minima are counted."""
        self.mean = MinimaArchive(np.ones(1))
        self.singles: list[MinimaArchive] = []
        self.history: list[Iteration] = []
        self.undiscovered = np.inf
        self._sequence = qmc.Sobol(dimension, rng=rng)
        self._rng, self._weights, self._progress = rng, weights, progress

    def draw(self, size: int) -> Indices:
        """Evaluate the next points of the Sobol sequence, as many as the budget allows.

        Raises
        ------
        InputError
            If the weights do not fit, or if all of the first points failed.
        """
        size = min(max(size, 0), self.log.left)
        rows, values = self.log.evaluate(self._sequence.random(size if len(self.sample) else 2 ** int(np.log2(size))))
        if len(self.sample) == 0:
            if not np.isfinite(values).all(axis=1).any():
                cure = "Check the model, or narrow the bounds"
                raise InputError.of("search", f"all {len(values)} start points failed", cure)
            count = values.shape[1]
            self.mean = MinimaArchive(normalised_weights(self._weights, count))
            self.singles = [MinimaArchive(row) for row in np.eye(count)] if count > 1 else []
            self.log.reserved = self.settings.reserved(count)
        self.sample = np.concatenate([self.sample, rows])
        return rows

    def descend(self, archive: MinimaArchive, rows: Indices, found_by: str, most: int | None = None) -> None:
        """Descend from the points that single linkage chooses among the rows: all of them, or the ``most`` best."""
        points, cost = self.log.points[rows], archive.cost(self.log.values[rows])
        starts = rows[linked_starts(points, cost, self._start_share)]
        self.descend_from(archive, starts, interquartile_range(cost), found_by, most)

    def descend_from(
        self, archive: MinimaArchive, starts: Indices, scale: float, found_by: str, most: int | None = None
    ) -> None:
        """Descend from the starts, best first, that are new and outside of the tabu radius of known minima.

        Parameters
        ----------
        archive
            What is minimised, and its minima so far.
        starts
            Rows of the log.
        scale
            Interquartile range of the cost, by which a hill between minima is measured.
        found_by
            The stage of the search.
        most
            Starts at most.
        """
        settings, log = self.settings, self.log
        points, cost = log.points, archive.cost(log.values)
        waiting = [int(row) for row in starts if int(row) not in archive.started]

        def unknown(k: int) -> bool:
            """Asked when its turn comes: against the minima that are known then."""
            if archive.distance(points[k]) < archive.tabu_radius:
                return False
            if not settings.test_starts or not in_known_basin(log, archive, points[k], cost[k], scale):
                return True
            archive.started.add(k)
            return False

        outside = islice(filter(unknown, waiting), most)
        while log.gradients_left > 0 and (batch := list(islice(outside, settings.together))):
            archive.started.update(batch)
            for _, end in descend(log, [(archive, points[k], None) for k in batch], settings.descent, settings.tabu):
                add_if_new(log, archive, end, scale, settings.merge, found_by)

    def complete(self, found_by: str = "") -> None:
        """Draw and descend, round by round, until few minima are expected undiscovered or the budget is spent."""
        settings, log = self.settings, self.log
        if len(self.sample) == 0:
            self.draw(settings.round)
        while True:
            self.descend(self.mean, self.sample, found_by)
            counted = int(self._start_share * len(self.sample))
            self.undiscovered = expected_undiscovered(counted, len(self.mean.ends))
            self.note()
            log.reserved = settings.reserved(len(self.mean.weights), len(self.mean.ends), log.points.shape[1])
            if self.is_complete or log.left == 0:
                break
            self.draw(max(settings.round, len(self.sample) // 20))

    @property
    def _start_share(self) -> float:
        """Better share of the points from which a descent may start now."""
        settings, log, ends = self.settings, self.log, self.mean.ends
        if log.used < settings.late or not ends:
            return settings.start_share
        cost = self.mean.cost(log.values)
        limit = self.mean.best + settings.deep * float(np.ptp(cost[np.isfinite(cost)]))
        return settings.start_share_after(log.used, float(np.mean([end.cost <= limit for end in ends])))

    @property
    def is_complete(self) -> bool:
        """Whether few enough minima are expected undiscovered."""
        return self.settings.undiscovered is not None and self.undiscovered < self.settings.undiscovered

    def finish(self, others: Indices, found_by: tuple[str, str] = ("", ""), tighten: bool = True) -> None:
        """Tighten the minima, find those of each objective, and fill the front with what is left.

        Parameters
        ----------
        others
            Rows, beside the sample, from which a single objective may be minimised.
        found_by
            Stage that a minimum belongs to whose start is among those, and among the sample.
        tighten
            False where a descent would not tighten.
        """
        self.log.reserved = 0
        if tighten and self.settings.final_tolerance is not None:
            self.mean = self._tightened(self.settings.final_tolerance)
        if self.singles:
            log, settings = self.log, self.settings
            for_singles = max(0, log.left - settings.front_evaluations)
            if settings.single_most is not None:
                for_singles = min(for_singles, settings.single_evaluations)
            log.reserved = log.left - for_singles
            self._minimise_singles(others, found_by)
            log.reserved = 0
            if settings.front_most is not None:
                log.reserved = max(0, log.left - settings.front_evaluations)
            fill_front(log, self.mean, self._rng, settings.front_candidates)

    def best_of_sample(self) -> Indices:
        """Rows of the better share of the sample."""
        cost = self.mean.cost(self.log.values[self.sample])
        best = np.argsort(cost, kind="stable")[: max(1, int(self.settings.start_share * len(self.sample)))]
        return np.asarray(self.sample[best])

    def result(self, population: Indices, labels: Indices, **more: Any) -> SearchResult:
        """What was found; the population, its clusters and more are the caller's."""
        ends: dict[int, tuple[Endpoint, int]] = {}
        for objective, archive in enumerate([self.mean, *self.singles], start=-1):
            for end in archive.ranked:
                ends.setdefault(end.row, (end, objective))
        found_by = tuple(end.found_by for end, _ in ends.values())
        values = self.log.values
        return SearchResult(
            points=self.log.points,
            objectives=values,
            cost=self.mean.cost(values),
            archived=np.array(list(ends), dtype=np.int64),
            population=population,
            labels=labels,
            front=nondominated(values),
            history=tuple(self.history),
            gradients=self.log.with_gradient,
            expected_undiscovered=float(self.undiscovered),
            complete=self.is_complete,
            found_by=found_by if any(found_by) else (),
            minimises=tuple(objective for _, objective in ends.values()),
            **more,
        )

    def note(self) -> None:
        """Add a line to the history, and tell the progress."""
        used, mean = self.log.used, self.mean
        self.history.append(Iteration(used, mean.best, len(mean.ends), mean.tabu_radius))
        if self._progress is not None:
            self._progress(used, self.log.budget, f"best {mean.best:.4g}, {len(mean.ends)} minima")

    def _minimise_singles(self, others: Indices, found_by: tuple[str, str]) -> None:
        """Minima of each objective: those near the best of the weighted mean, then from points, in turn."""
        log, settings = self.log, self.settings
        best = self.mean.ranked[: settings.single_starts]
        for stage in dict.fromkeys(end.found_by for end in best):
            near = [(one, end.point, end.inverse) for end in best for one in self.singles if end.found_by == stage]
            for archive, end in descend(log, near, settings.descent, settings.tabu):
                add_if_new(log, archive, end, 0.0, settings.merge, stage)
        while log.gradients_left > 0:
            before = log.used
            for one in self.singles:
                for rows, stage in zip((others, self.sample), found_by, strict=True):
                    self.descend(one, rows, stage, most=1)
            if log.used == before:
                break

    def _tightened(self, tolerance: float) -> MinimaArchive:
        """The minima after one more descent from the curvature found there, best first; those that meet are merged."""
        fine = DescentSettings(longest_step=0.01, tolerance=tolerance)
        tight = MinimaArchive(self.mean.weights)
        for end in self.mean.ranked:
            for _, better in descend(self.log, [(self.mean, end.point, end.inverse)], fine, 0.0) or [(self.mean, end)]:
                if tight.distance(better.point) >= self.settings.merge:
                    tight.add(replace(better, found_by=end.found_by))
        return tight


def interquartile_range(cost: FloatArray) -> float:
    """Interquartile range of the finite costs; 0 of three or fewer."""
    return float(np.subtract(*np.quantile(cost[np.isfinite(cost)], [0.75, 0.25]))) if len(cost) > 3 else 0.0
