"""Optimal design: which tests of a design space to run in the time there is, and what they are expected to give."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.experimental_design.candidates import Candidate, RigLimits, output_violation
from mofit.experimental_design.criteria import Criterion, Discrimination, box_precision, scales, sd_over_samples
from mofit.experimental_design.exchange import CandidatePool, best_selection
from mofit.experimental_design.identifiability import Identifiability, identifiability
from mofit.experimental_design.information import (
    Information,
    SourceInformation,
    candidate_information,
    estimator_precision,
)
from mofit.experimental_design.target import Target
from mofit.runtime.progress import Progress, silent


@dataclass(frozen=True)
class DesignSettings:
    """Numbers of the method."""

    periods: int = 8
    """Periods of a periodic candidate that are simulated in the search; the design itself is evaluated as it will
    run."""
    shares: tuple[float, ...] = (0.125, 0.25, 0.5, 0.75, 1.0)
    """Times for which the best design is searched, as shares of the budget."""


SETTINGS = DesignSettings()


@dataclass(frozen=True)
class ParetoPoint:
    """The best design of a time: seconds, value of the criterion, and its tests as (name, times run)."""

    seconds: float
    value: float
    tests: tuple[tuple[str, int], ...]


@dataclass(frozen=True, eq=False)
class Design:
    """An optimal design and what it is based on."""

    known: SourceInformation
    """Information of the tests that there are, and the parameter samples."""
    criterion: Criterion | Discrimination
    """What was minimised."""
    names: tuple[str, ...]
    """Parameters whose uncertainty is shown."""
    candidates: tuple[Candidate, ...]
    """All candidates, infeasible ones included, with the reason."""
    tests: tuple[tuple[Candidate, int], ...]
    """The tests chosen, as (candidate, times run)."""
    seconds: float
    """Time it takes, overheads included."""
    exhaustive: bool
    """Whether every selection that fits was evaluated."""
    before: Identifiability
    after: Identifiability
    """Identifiability without and with the design."""
    value_before: float
    value_after: float
    """Of the criterion: a relative standard deviation, or a noncentrality."""
    singles: FloatArray
    """Value of the criterion with one candidate more, (C,); nan for infeasible ones."""
    single_sd: FloatArray
    """Relative standard deviation of every shown parameter with that candidate, (C, k); nan for infeasible ones."""
    without: FloatArray
    """Relative standard deviations without one of the design's tests, over those with all of them, (tests, k)."""
    pareto: tuple[ParetoPoint, ...]
    """Best designs for less time."""
    target: Target | None
    """The conditions under which the parameters shown are meant."""
    relative_sd: tuple[FloatArray, FloatArray]
    """Relative standard deviations of the parameters shown without and with the design, (N, k)."""


@dataclass(frozen=True, eq=False)
class DesignEvaluation:
    """Evaluates designs by relative changes of the parameters, at the samples."""

    known: SourceInformation
    """Information of the tests that there are."""
    criterion: Criterion | Discrimination
    """What is minimised."""
    ignore_existing: bool = False
    """Whether only their calibration stages count."""
    jobs: int = 1
    """Threads; results do not depend on it."""

    @cached_property
    def size(self) -> FloatArray:
        """Change of each parameter that counts as relative, (N, d)."""
        return scales(self.known.source.space, self.known.samples)

    @cached_property
    def factor(self) -> FloatArray:
        """By what matrices in the unit cube are multiplied to become those of relative changes, (N, d, d)."""
        ratio = self.size / self.known.derivative
        return np.asarray(ratio[:, :, None] * ratio[:, None, :])

    @cached_property
    def box(self) -> FloatArray:
        """Precision from the bounds alone, (N, d, d)."""
        return box_precision(self.known.source.space, self.known.samples)

    @cached_property
    def _kept(self) -> list[int]:
        tests = self.known.source.tests
        return [i for i, test in enumerate(tests) if test.group > 0 or not self.ignore_existing]

    @cached_property
    def existing(self) -> FloatArray:
        """H and J of the tests that there are, (N, G, 2, d, d)."""
        return np.asarray(self.known.tests.estimator[self._kept].sum(axis=0) * self.factor[:, None, None])

    @cached_property
    def start(self) -> FloatArray:
        """What the criterion is computed from, without candidates."""
        if isinstance(self.criterion, Criterion):
            return self.existing
        return np.asarray(self.known.tests.fisher[self._kept].sum(axis=0) * self.factor)

    def contribution(self, found: Information) -> FloatArray:
        """What each test adds to it."""
        return found.estimator if isinstance(self.criterion, Criterion) else found.fisher

    def objective(self, total: FloatArray) -> FloatArray:
        """Logarithm of the criterion of such sums."""
        if isinstance(self.criterion, Criterion):
            return self.criterion(estimator_precision(total) + self.box)
        return self.criterion(total)

    def pool(self, found: Information, seconds: FloatArray) -> CandidatePool:
        """Tests that take so long, for the search."""
        return CandidatePool(self.contribution(found), self.start, seconds, self.objective)

    def identifiability(self, more: FloatArray) -> Identifiability:
        """Identifiability with H and J of more tests, (N, G, 2, d, d)."""
        precision = estimator_precision(self.existing + more) / self.factor
        return identifiability(precision, self.known.samples, self.known.source.space)

    def relative_sd(self, more: FloatArray, rows: FloatArray) -> FloatArray:
        """Relative standard deviations (..., N, k) of what rows (N, k, d) weight relative changes to, with more tests.

        The bounds are taken as Gaussian: for rankings.
        """
        covariance = np.linalg.inv(estimator_precision(self.existing + more) + self.box)
        return np.asarray(np.sqrt(np.sum((rows @ covariance) * rows, axis=-1)))

    def information(self, tests: Sequence[Candidate], periods: int | None = None) -> Information:
        """Information of candidates per relative change; see `candidate_information`."""
        source, experiments = self.known.source, [test.experiment for test in tests]
        return candidate_information(
            source.model, experiments, self.known.samples, self.size, source.noise, self.jobs, periods
        )

    def feasible(self, tests: Sequence[Candidate], limits: RigLimits) -> tuple[tuple[Candidate, ...], Information]:
        """Candidates with the limits of the outputs checked as well, and their information (zero if infeasible)."""
        outputs = [channel.name for channel in self.known.source.model.outputs]
        allowed = [i for i, test in enumerate(tests) if not test.infeasible]
        found = self.information([tests[i] for i in allowed], SETTINGS.periods)
        checked = list(tests)
        for i, peaks, fisher in zip(allowed, found.peaks, found.fisher, strict=True):
            broken = output_violation(dict(zip(outputs, peaks.tolist(), strict=True)), limits)
            checked[i] = replace(
                tests[i], infeasible=broken if np.isfinite(fisher).all() else "the model gives no finite output"
            )

        def placed(values: FloatArray) -> FloatArray:
            whole = np.zeros((len(tests), *values.shape[1:]))
            whole[allowed] = values
            return whole

        return tuple(checked), Information(placed(found.estimator), placed(found.fisher), placed(found.peaks))


def optimal_design(
    evaluation: DesignEvaluation,
    candidates: Sequence[Candidate],
    limits: RigLimits,
    names: Sequence[str],
    budget: float,
    progress: Progress = silent,
    target: Target | None = None,
) -> Design:
    """Find the best tests.

    Candidates whose output would exceed the rig's limits are infeasible. The uncertainty of the named parameters is
    shown, under the conditions of a target. The budget is the time there is [s].

    Raises
    ------
    InputError
        If no candidate is left within the limits and the budget.
    """
    criterion, known = evaluation.criterion, evaluation.known
    progress("candidates", 0, len(candidates), f"{len(candidates)} tests at {len(known.samples)} parameter samples")
    checked, found = evaluation.feasible(candidates, limits)
    seconds = np.array([candidate.seconds for candidate in checked])
    usable = np.array([not candidate.infeasible for candidate in checked])
    if not np.any(usable & (seconds <= budget)):
        if usable.any():
            least = f"the shortest candidate takes {min(seconds[usable]):g} s"
            raise InputError.of("--budget", least, "Raise the budget, or offer shorter tests")
        raise InputError.of("space", f"every candidate is infeasible: {checked[0].infeasible}", "Widen the space")
    # what is infeasible never fits
    pool = evaluation.pool(found, np.where(usable, seconds, np.inf))
    pareto = []
    for share in SETTINGS.shares:
        if np.any(pool.seconds <= share * budget):
            progress("design", share, 1.0, f"in {share * budget:.0f} s")
            best = best_selection(pool, share * budget, progress)
            tests = Counter(checked[i].name for i in best.members)
            pareto.append(ParetoPoint(best.seconds, criterion.shown(best.value), tuple(tests.items())))
    chosen = tuple((checked[i], times) for i, times in Counter(best.members).items())
    exact = evaluation.information([candidate for candidate, _ in chosen])
    times = np.array([float(number) for _, number in chosen])
    rows = _rows(evaluation, names, target)
    none = np.zeros_like(found.estimator[0])
    whole = np.tensordot(times, exact.estimator, axes=1)
    fewer = np.tensordot(times - np.diag(times), exact.estimator, axes=1)
    total = evaluation.start + np.tensordot(times, evaluation.contribution(exact), axes=1)
    before, after = (evaluation.relative_sd(more, rows) for more in (none, whole))
    ratio = evaluation.relative_sd(fewer, rows) / after
    single_sd = np.moveaxis(evaluation.relative_sd(found.estimator, rows), 1, -1)
    return Design(
        known=known,
        criterion=criterion,
        names=tuple(names),
        candidates=checked,
        tests=chosen,
        seconds=best.seconds,
        exhaustive=best.exhaustive,
        before=evaluation.identifiability(none),
        after=evaluation.identifiability(whole),
        value_before=criterion.shown(float(evaluation.objective(evaluation.start))),
        value_after=criterion.shown(float(evaluation.objective(total))),
        singles=np.array([criterion.shown(pool.value((i,))) if usable[i] else np.nan for i in range(len(checked))]),
        single_sd=np.where(usable[:, None], sd_over_samples(single_sd, criterion.aggregate), np.nan),
        without=np.median(ratio, axis=1),
        pareto=tuple(pareto),
        target=target,
        relative_sd=(before, after),
    )


def _rows(evaluation: DesignEvaluation, names: Sequence[str], target: Target | None) -> FloatArray:
    """Relative changes of the parameters shown by those of all, (N, k, d)."""
    space, count = evaluation.known.source.space, len(evaluation.known.samples)
    every = np.broadcast_to(np.eye(len(space)), (count, len(space), len(space))) if target is None else target.rows
    return every[:, [space.index(name) for name in names]]
