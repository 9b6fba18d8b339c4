"""The next tests: which of a declared space to run in the time there is, and what they will tell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.errors import InputError
from mofit.identifiability.candidates import Candidate
from mofit.identifiability.criteria import Goal, box_precision, scales
from mofit.identifiability.limits import Reach, refusal
from mofit.identifiability.programme import Pool, best_programme
from mofit.identifiability.separate import Rivalry
from mofit.identifiability.statistics import Statistics, precision, statistics
from mofit.identifiability.telling import Told
from mofit.identifiability.verdicts import Spread, spread
from mofit.progress import Progress, silent

Array = NDArray[np.float64]

#: Periods of a periodic candidate that are simulated in the search; the programme itself is judged as it will be run.
PERIODS = 8
#: Error of the integration in the search, relative to the range of the output.
TOLERANCE = 1e-4
#: Times at which the best programme is looked for, as shares of the budget.
SHARES = (0.125, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Point:
    """The best programme of a time: its tests as (name, times run), seconds, and value of the criterion."""

    seconds: float
    value: float
    tests: tuple[tuple[str, int], ...]


@dataclass(frozen=True, eq=False)
class Design:
    """A programme of tests, and what it rests on.

    Parameters
    ----------
    told
        What the tests that are there already tell, and where all was judged.
    goal
        What was minimised.
    names
        Parameters whose spread is shown.
    candidates
        All tests that could be run, refused ones included, with the reason.
    programme
        The tests chosen, as (candidate, times run).
    seconds
        Time it takes, overheads included.
    exhaustive
        Whether every programme that fits was looked at.
    before, after
        Expected spread without and with the programme.
    value_before, value_after
        Of the criterion: a relative standard deviation; for rival effects the noncentrality.
    singles
        Value of the criterion with one candidate more, (C,); nan for refused ones.
    single_sd
        Relative standard deviation of every shown parameter with that candidate, (C, k); nan for refused ones.
    without
        Relative standard deviations with one of the programme's tests left out, over those with all of it, (tests, k).
    pareto
        Best programmes for less time.
    """

    told: Told
    goal: Goal | Rivalry
    names: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    programme: tuple[tuple[Candidate, int], ...]
    seconds: float
    exhaustive: bool
    before: Spread
    after: Spread
    value_before: float
    value_after: float
    singles: Array
    single_sd: Array
    without: Array
    pareto: tuple[Point, ...]


def design(
    told: Told,
    candidates: Sequence[Candidate],
    limit: Reach,
    goal: Goal | Rivalry,
    names: Sequence[str],
    budget: float,
    *,
    fresh: bool = False,
    jobs: int = 1,
    progress: Progress = silent,
) -> Design:
    """Find the programme.

    Parameters
    ----------
    told
        What the tests that are there already tell; its parameter sets are those that the design is judged at.
    candidates
        The tests that could be run.
    limit
        What the rig can do; candidates whose output would be larger are refused here.
    goal
        What is minimised; a `Rivalry` for telling effects apart.
    names
        Parameters whose spread is shown.
    budget
        Time there is [s].
    fresh
        Start from the calibration stages alone.
    jobs, progress
        Threads (results do not depend on it), and who is told what is being done.

    Raises
    ------
    InputError
        If no candidate is left within the limits and the budget.
    """
    frame = Frame.of(told, goal, fresh)
    progress("candidates", 0, len(candidates), f"{len(candidates)} tests at {len(told.values)} parameter sets")
    checked, found = _asked(frame, candidates, limit, jobs)
    seconds = np.array([candidate.seconds for candidate in checked])
    usable = np.array([not candidate.refused for candidate in checked])
    if not np.any(usable & (seconds <= budget)):
        if usable.any():
            least = f"the shortest candidate takes {min(seconds[usable]):g} s"
            raise InputError.of("--budget", least, "Raise the budget, or offer shorter tests")
        raise InputError.of("space", f"the rig refuses every test: {checked[0].refused}", "Widen the space")
    # what is refused never fits
    pool = frame.pool(found, np.where(usable, seconds, np.inf))
    pareto = []
    for share in SHARES:
        if np.any(pool.seconds <= share * budget):
            progress("programme", share, 1.0, f"in {share * budget:.0f} s")
            best = best_programme(pool, share * budget, progress)
            tests = Counter(checked[i].name for i in best.members)
            pareto.append(Point(best.seconds, shown(goal, best.value), tuple(tests.items())))
    programme = tuple((checked[i], times) for i, times in Counter(best.members).items())
    exact = frame.ask([candidate for candidate, _ in programme], jobs)
    times = np.array([float(number) for _, number in programme])
    places = [told.source.space.index(name) for name in names]
    after = frame.spread(np.tensordot(times, exact.values, axes=1))
    fewer = np.tensordot(times - np.diag(times), exact.values, axes=1)
    whole = frame.relative(np.tensordot(times, exact.values, axes=1))
    return Design(
        told=told,
        goal=goal,
        names=tuple(names),
        candidates=checked,
        programme=programme,
        seconds=best.seconds,
        exhaustive=best.exhaustive,
        before=frame.spread(np.zeros_like(found.values[0])),
        after=after,
        value_before=shown(goal, float(frame.objective(frame.start))),
        value_after=shown(
            goal, float(frame.objective(frame.start + np.tensordot(times, frame.told_by(exact), axes=1)))
        ),
        singles=np.array([shown(goal, pool.value((i,))) if usable[i] else np.nan for i in range(len(checked))]),
        single_sd=np.where(usable[:, None], np.median(frame.relative(found.values)[..., places], axis=1), np.nan),
        without=np.median((frame.relative(fewer) / whole)[..., places], axis=1),
        pareto=tuple(pareto),
    )


def shown(goal: Goal | Rivalry, value: float) -> float:
    """A value of the criterion as people read it: a relative standard deviation, or a noncentrality."""
    return float(np.exp(-value if isinstance(goal, Rivalry) else value / 2))


@dataclass(frozen=True, eq=False)
class Frame:
    """Where all is judged, and in what scale.

    ``size`` (N, d) makes changes relative, ``factor`` (N, d, d) does so for matrices in the unit cube; ``sums`` is what
    is known without candidates, ``start`` what the goal looks at of it.
    """

    told: Told
    goal: Goal | Rivalry
    size: Array
    factor: Array
    box: Array
    sums: Array
    start: Array

    @classmethod
    def of(cls, told: Told, goal: Goal | Rivalry, fresh: bool) -> Frame:
        """For a goal, on top of the tests of ``told``, or (``fresh``) of its calibration stages alone."""
        size = scales(told.source.space, told.values)
        ratio = size / told.stretch
        factor = ratio[:, :, None] * ratio[:, None, :]
        kept = [i for i, test in enumerate(told.source.tests) if test.group > 0 or not fresh]
        box = box_precision(told.source.space, told.values) * size[:, :, None] * size[:, None, :]
        sums = told.sums[kept].sum(axis=0) * factor[:, None, None]
        start = told.information[kept].sum(axis=0) * factor if isinstance(goal, Rivalry) else sums
        return cls(told, goal, size, factor, box, sums, start)

    def told_by(self, found: Statistics) -> Array:
        """What the goal looks at of each test."""
        return found.information if isinstance(self.goal, Rivalry) else found.values

    def objective(self, total: Array) -> Array:
        """The goal, of such totals."""
        return self.goal(total) if isinstance(self.goal, Rivalry) else self.goal(precision(total) + self.box)

    def pool(self, found: Statistics, seconds: Array) -> Pool:
        """Tests that take so long, for the search."""
        return Pool(self.told_by(found), self.start, seconds, self.objective)

    def spread(self, more: Array) -> Spread:
        """Expected spread with sums of some tests more, (N, G, 2, d, d)."""
        return spread(precision(self.sums + more) / self.factor, self.told.values, self.told.source.space)

    def relative(self, more: Array) -> Array:
        """Relative standard deviations (..., N, d) with such sums more, the bounds taken as Gaussian: for rankings."""
        covariance = np.linalg.inv(precision(self.sums + more) + self.box)
        return np.asarray(np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)))

    def ask(
        self, tests: Sequence[Candidate], jobs: int, periods: int | None = None, tolerance: float = TOLERANCE
    ) -> Statistics:
        """What tests tell at the parameter sets."""
        source = self.told.source
        procedures = [test.procedure for test in tests]
        return statistics(source.model, procedures, self.told.values, self.size, source.noise, jobs, periods, tolerance)


def _asked(
    frame: Frame, tests: Sequence[Candidate], limit: Reach, jobs: int
) -> tuple[tuple[Candidate, ...], Statistics]:
    """What the candidates tell (nothing, where refused), and them with what their outputs would be checked as well."""
    outputs = [channel.name for channel in frame.told.source.model.outputs]
    allowed = [i for i, test in enumerate(tests) if not test.refused]
    found = frame.ask([tests[i] for i in allowed], jobs, PERIODS)
    checked = list(tests)
    for i, peaks, information in zip(allowed, found.peaks, found.information, strict=True):
        asked = Reach(limit.channel, 0.0, 0.0, 0.0, 0.0, 0.0, dict(zip(outputs, peaks.tolist(), strict=True)))
        refused = refusal(asked, limit, "") if np.isfinite(information).all() else "the model gives no finite output"
        checked[i] = replace(tests[i], refused=refused)

    def placed(values: Array) -> Array:
        whole = np.zeros((len(tests), *values.shape[1:]))
        whole[allowed] = values
        return whole

    everything = Statistics(placed(found.values), placed(found.information), placed(found.peaks))
    return tuple(checked), everything
