"""Procedures compared: what each would tell of each parameter, with what certainty, and which test carries it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.identifiability.comparison import Carried, Comparison, Entry, Judged, Procedure
from mofit.identifiability.confirm import RISE, Expectation, Limits, expect, profiles
from mofit.identifiability.sentences import carried_by, sentence
from mofit.identifiability.sources import Source
from mofit.identifiability.telling import Told
from mofit.identifiability.verdicts import (
    BOX_PRECISION,
    COMBINATION,
    IDENTIFIABLE,
    NOT,
    ONE_SIDED,
    VERDICTS,
    Spread,
    condition_indices,
    good,
    partners,
    relative_size,
    spread,
)
from mofit.parameters import ParameterSpace
from mofit.progress import Progress, silent

Array = NDArray[np.float64]

#: Name of the procedure that is all tests of a file.
ALL = "all"


def procedures_of(sources: Sequence[Source], groups: Mapping[str, Sequence[str]]) -> tuple[Procedure, ...]:
    """What is compared: the groups named, else the files if there are several, else every test alone and all.

    Raises
    ------
    InputError
        If a group's tests are not in one file, or a file has no test for the main identification.
    """
    if groups:
        return tuple(_group(name, tests, sources) for name, tests in groups.items())
    raise_errors(
        Fault(f"'{source.name}'", f"no test is left for model '{source.model.name}'", "Name some with --group")
        for source in sources
        if not source.main
    )
    every = [tuple(test.name for test in source.main) for source in sources]
    if len(sources) > 1:
        return tuple(Procedure(source.name, i, every[i]) for i, source in enumerate(sources))
    alone = tuple(Procedure(test, 0, (test,)) for test in every[0])
    return (*alone, Procedure(ALL, 0, every[0])) if len(alone) > 1 else alone


def _group(name: str, tests: Sequence[str], sources: Sequence[Source]) -> Procedure:
    for place, source in enumerate(sources):
        if set(tests) <= {test.name for test in source.main}:
            return Procedure(name, place, tuple(tests))
    known = sorted({test.name for source in sources for test in source.main})
    missing = next((test for test in tests if test not in known), None)
    if missing is None:
        raise InputError.of(f"--group {name}", "its tests are in different files", "Name tests of one file")
    raise InputError.of(f"--group {name}", f"no test '{missing}'", did_you_mean(missing, known))


#: Width of a Gaussian's profile interval in its standard deviations.
_WIDTH = 2 * float(np.sqrt(2 * RISE))


def compare(
    told: Sequence[Told],
    procedures: Sequence[Procedure],
    asked: Sequence[str] = (),
    *,
    jobs: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Compare procedures.

    Parameters
    ----------
    told
        What the tests of every source tell; verdicts are confirmed at the first parameter set.
    procedures
        What is compared.
    asked
        Parameters to be shown; by default those that no calibration stage knows.
    jobs
        Threads; results do not depend on it.
    progress
        Told what is being done.

    Raises
    ------
    InputError
        For parameters that the model does not have.
    """
    names = told[0].source.space.names
    raise_errors(
        Fault(f"--parameter {name}", f"model '{told[0].source.model.name}' has no such parameter",
              did_you_mean(name, names)) for name in asked if name not in names
    )  # fmt: skip
    known = {name for each in told for name in each.source.calibrated}
    shown = tuple(asked) or tuple(name for name in names if name not in known) or names
    expectations: dict[int, Expectation] = {}
    judged = []
    for number, procedure in enumerate(procedures):
        progress("compare", number, len(procedures), procedure.name)
        own = told[procedure.source]
        found = spread(own.precision(procedure.tests), own.values, own.source.space)
        places = [names.index(name) for name in shown]
        limits: list[Limits | None] = [None] * len(names)
        if np.any(_majority(found.words[:, places]) > 0) and np.isfinite(found.sd[0]).all():
            if procedure.source not in expectations:
                expectations[procedure.source] = expect(own, jobs)
            limits = list(profiles(expectations[procedure.source], procedure.tests, found))
        judged.append(_judge(own, procedure, found, shown, limits))
    carried = tuple(_carried(told[p.source], p, shown) for p in procedures if len(p.tests) > 1)
    notes = [note for each in told for note in each.source.notes]
    notes += [carried_by(each, k, name) for each in carried for k, name in enumerate(shown)]
    return Comparison(shown, tuple(asked), tuple(told), tuple(judged), carried, tuple(dict.fromkeys(notes)))


def _judge(
    told: Told, procedure: Procedure, found: Spread, shown: Sequence[str], limits: Sequence[Limits | None]
) -> Judged:
    source = told.source
    space, values, stretch = source.space, told.values[0], told.stretch[0]
    seconds = sum(test.seconds for test in source.main if test.name in procedure.tests)
    bound = spread(told.bound(procedure.tests)[:1], told.values[:1], space)
    minute = spread(told.precision(procedure.tests, 60 / seconds)[:1], told.values[:1], space)
    usable = found.words[:, 0] >= 0
    entries = {}
    sizes = relative_size(space, told.values[:1])[0]
    for name in shown:
        k = space.index(name)
        size = float(sizes[k])
        words = found.words[usable, k]
        counts = {VERDICTS[word]: int(np.sum(words == word)) for word in np.unique(words)}
        verdict = VERDICTS[int(_majority(words[:, None])[0])]
        if verdict != IDENTIFIABLE and limits[k] is not None:
            verdict = _confirmed(verdict, limits[k], size)  # type: ignore[arg-type]
        others = [space.names[j] for j in partners(found.covariance[0], k, size)] if verdict == COMBINATION else []
        relative = float(np.median(found.relative[usable, k]))
        entries[name] = Entry(
            parameter=name,
            verdict=verdict,
            sd=float(np.median((found.sd * told.stretch)[usable, k])),
            relative_sd=relative,
            sd_here=_spread_here(float(found.sd[0, k] * stretch[k]), limits[k], space.subset([name])),
            low=float(np.min(found.relative[usable, k])),
            high=float(np.max(found.relative[usable, k])),
            bound_sd=float(bound.sd[0, k] * stretch[k]),
            conditional_sd=float(found.conditional[0, k] * stretch[k]),
            inflation=float(found.inflation[0, k]),
            per_minute=float(minute.relative[0, k]),
            verdicts=counts,
            partners=tuple(others),
            limits=limits[k],
            sentence=sentence(name, verdict, relative, limits[k], others, found.covariance[0], values, space),
        )
    places = [k for k, name in enumerate(space.names) if name not in source.calibrated] or list(range(len(space)))
    inner = np.linalg.inv(found.covariance[0][np.ix_(places, places)])
    return Judged(procedure, seconds, entries, found.covariance[0], float(condition_indices(inner)[-1]))


def _majority(words: NDArray[np.int64]) -> NDArray[np.int64]:
    """Most frequent verdict over the parameter sets that could be simulated, (d,); the worse one of a tie."""
    counts = np.stack([np.sum(words == k, axis=0) for k in range(len(VERDICTS))])
    return np.asarray(len(VERDICTS) - 1 - np.argmax(counts[::-1], axis=0))


def _confirmed(verdict: str, limits: Limits, size: float) -> str:
    """The verdict that a profile leaves of a local one."""
    if verdict == COMBINATION:
        return verdict
    if limits.closed == 1:
        return ONE_SIDED
    half = np.asarray((limits.high - limits.low) / _WIDTH)
    return IDENTIFIABLE if limits.closed == 2 and bool(good(half, np.asarray(size))) else NOT


def _spread_here(sd: float, limits: Limits | None, space: ParameterSpace) -> float:
    """Expected standard deviation: the profile's where it is closed, since it sees curvature that derivatives miss."""
    if limits is None or limits.closed < 2:
        return sd
    low, high = (float(space.from_unit(np.array([end]))[0]) for end in (limits.low, limits.high))
    return (high - low) / _WIDTH


def _carried(told: Told, procedure: Procedure, shown: Sequence[str]) -> Carried:
    r"""Shares of the tests in the precision of every parameter, and what is lost without them.

    With the Fisher information :math:`M = \sum_t F_t + P` and :math:`c = M^{-1} e_i`, the precision of parameter i is
    :math:`\sum_t c^T F_t c / c_i^2 + \dots`: a sum over tests that leaves out what other parameters can explain.
    """
    source = told.source
    index = [i for i, test in enumerate(source.tests) if test.group == 0 and test.name in procedure.tests]
    places = [source.space.index(name) for name in shown]
    information = told.information[index, 0]
    total = told.bound(procedure.tests)[0] + BOX_PRECISION * np.eye(len(source.space))
    columns = np.linalg.inv(total)[:, places]
    diagonal = columns[places, range(len(places))]
    share = np.einsum("ip,tij,jp->tp", columns, information, columns) / diagonal
    calibration = np.einsum("ip,ij,jp->p", columns, told.bound(())[0], columns) / diagonal
    every = spread(told.precision(procedure.tests)[:1], told.values[:1], source.space).sd[0, places]
    names = tuple(source.tests[i].name for i in index)
    without = [
        spread(told.precision([other for other in names if other != name])[:1], told.values[:1], source.space).sd[0]
        for name in names
    ]
    return Carried(procedure.name, names, share, calibration, np.array(without)[:, places] / every)
