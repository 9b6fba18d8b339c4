"""Tests cut to a few periods: of a model that repeats they tell the same, at a fraction of the cost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.diagnosis.spectral_classes import CLASS_INDEX
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.diagnosis.whitening import ELSEWHERE, Whitening
from mofit.simulation import Simulator

#: Share of the samples that must be left out for this to pay.
_WORTH = 0.5


@dataclass(frozen=True)
class FewPeriods:
    """A hypothesis on tests cut to a few periods, and half the squares of what does not repeat in the whole ones."""

    hypothesis: Hypothesis
    left_out: float


def few_periods(model: Hypothesis, changing: bool = False) -> FewPeriods | None:
    """The hypothesis on tests `cut`, also with inputs that are ``changing``; None where they cannot be."""
    found = cut(model.observed, model.simulator, changing)
    if found is None:
        return None
    observed, simulator = found
    return FewPeriods(replace(model, observed=observed, simulator=simulator), 0.5 * averaged(model.observed)[1])


def at_steps_for(model: Hypothesis, u: FloatArray, fewest: int = 1) -> Hypothesis:
    """`Hypothesis.at_steps_for`, judged by a few periods where the inputs repeat."""
    few = few_periods(model)
    return model.with_steps((few.hypothesis if few else model).at_steps_for(u, fewest).steps)


def cut(observed: WhitenedData, simulator: Simulator, changing: bool = False) -> tuple[WhitenedData, Simulator] | None:
    """Tests with the fewest periods that fill whole samples, and a simulator on them.

    None where that saves little, where inputs do not repeat (the time of a drift is one) unless they may be
    ``changing``, or of a user's simulator.
    """
    experiments = simulator.experiments
    if observed.problem.evaluations is not None:
        return None
    if not changing and not all(
        w.repeats(experiments[test].inputs[experiments[test].lead :]) for test, _, w in observed.records
    ):
        return None
    short, _ = averaged(observed)
    kept = [one.recorded for one in short.problem.experiments]
    brief = [experiment.first(count) for experiment, count in zip(experiments, kept, strict=True)]
    if sum(one.samples for one in brief) > _WORTH * sum(one.samples for one in experiments):
        return None
    return short, simulator.with_experiments(brief)


def averaged(observed: WhitenedData) -> tuple[WhitenedData, float]:
    """Records that repeat as their average over all periods, in rows of a few, and the squares of what differs.

    See `Whitening.of_few_periods`. Rows beside the harmonics, which are zero, count as other ones.
    """
    if observed not in _averaged:
        _averaged[observed] = _average(observed)
    return _averaged[observed]


#: Of the same tests many models are fitted.
_averaged: WeakKeyDictionary[WhitenedData, tuple[WhitenedData, float]] = WeakKeyDictionary()


def _average(observed: WhitenedData) -> tuple[WhitenedData, float]:
    records, found, squares = list[tuple[int, int, Whitening]](), [], 0.0
    tests, share = list(observed.problem.experiments), np.broadcast_to(observed.noise_share, len(observed.measured))
    ends, phase = [0] * len(tests), np.array(observed.phase)
    for i, (test, output, whole) in enumerate(observed.records):
        here, few = np.flatnonzero(observed.record == i), whole.of_few_periods()
        rows, place = observed.measured[here], np.arange(len(here))
        if whole.periods:
            signal = _repeating(whole, rows)
            squares += float(np.sum((rows - whole.rows(signal)[:, 0]) ** 2))
            rows, place = few.rows(signal)[:, 0], few.rows_among(whole)
            phase[i] += 2 * np.pi * (few.start - whole.start) * whole.step / whole.period
            measured = np.array(tests[test].measured)
            measured[whole.start : len(signal), output] = signal[whole.start :, 0]
            tests[test] = tests[test].changed(measured=measured)
        records.append((test, output, few))
        ends[test] = max(ends[test], few.start + few.count)
        classes = np.where(place < 0, CLASS_INDEX["other"], observed.spectral_class[here[place]])
        found.append((rows, np.full(len(rows), i), few.line_of_row, classes, share[here[place]]))
    measured, record, line, classes, share = (np.concatenate(one) for one in zip(*found, strict=True))
    brief = tuple(one.first(end) for one, end in zip(tests, ends, strict=True))
    short = replace(
        observed,
        problem=replace(observed.problem, experiments=brief),
        records=tuple(records),
        measured=measured,
        record=record,
        line=line,
        spectral_class=classes,
        phase=phase,
        noise_share=share,
    )
    return short, squares


def _repeating(whole: Whitening, rows: FloatArray) -> FloatArray:
    """What repeats of a record, from its rows (rows,), as its samples up to the last used, (samples, 1)."""
    signal = np.zeros((whole.start + whole.count, 1))
    signal[whole.start :, 0] = whole.waveform(rows)
    return signal


def repeats(observed: WhitenedData, rows: FloatArray) -> bool:
    """Whether rows (m, k) of a signal have hardly any power beside the harmonics of the tests that repeat."""
    beside = [(w.periods > 0) & ~w.harmonic[w.line_of_row] for *_, w in observed.records]
    power = np.sum(rows**2, axis=1)
    return bool(power[np.concatenate(beside)].sum() <= ELSEWHERE * power.sum())


def in_whole_rows(short: WhitenedData, whole: WhitenedData, rows: FloatArray) -> FloatArray:
    """Rows (..., rows) of averaged tests as those of whole ones, (..., m), of a model that repeats."""
    parts = list[FloatArray]()
    for i, ((*_, few), (*_, every)) in enumerate(zip(short.records, whole.records, strict=True)):
        own = rows[..., short.record == i]
        parts.append(few.repeated(every, own) if every.periods else own)
    return np.concatenate(parts, axis=-1)


def with_residual(short: WhitenedData, whole: WhitenedData, residual: FloatArray, present: FloatArray) -> WhitenedData:
    """Averaged tests, moved so that what a model leaves of them is the average of what it leaves of whole tests.

    A rig settles within a record, and so does its model: what is measured less what is simulated is averaged, rather
    than both apart. ``residual`` are the rows that the model leaves of whole tests, ``present`` those of averaged ones.
    """
    tests, wanted = list(short.problem.experiments), np.array(present)
    for i, (test, output, few) in enumerate(short.records):
        own, w = short.record == i, whole.records[i][2]
        if not w.periods:
            continue
        wanted[own] = few.rows(_repeating(w, residual[whole.record == i]))[:, 0]
        measured, used = np.array(tests[test].measured), slice(few.start, few.start + few.count)
        measured[used, output] += few.signal(wanted[own] - present[own])
        tests[test] = tests[test].changed(measured=measured)
    problem = replace(short.problem, experiments=tuple(tests))
    return replace(short, problem=problem, measured=short.measured + wanted - present)
