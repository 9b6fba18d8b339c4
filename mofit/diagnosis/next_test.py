"""The test that would tell alike explanations apart, or that none of those tried can."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Measurement, Procedure
from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.foresee import Foreseen, foresee, ruled_out
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.refit import Explanation
from mofit.diagnosis.verdict import weights
from mofit.diagnosis.whitening import Whitening
from mofit.drives import first_input, to_drive
from mofit.kernel import Drive
from mofit.model import Model, with_effects
from mofit.signals import Record

Array = NDArray[np.float64]

#: Shortest and longest test that is proposed, s; so many periods in any case.
_SECONDS, _LONGEST, _PERIODS = 20.0, 600.0, 4
#: Samples of the shortest one that are tried, more only for its periods: a second tells what all others do.
_SAMPLES = 4000
#: Periods at the start that are not judged.
_SETTLING = 1.0
#: Factors on the largest frequency, on the usual amplitude, and on the usual speed of the campaign that are tried.
_FREQUENCIES, _AMPLITUDES = (0.125, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0), (0.5, 1.0, 2.0, 3.0)
_SPEEDS = (1 / 3, 1.0, 1.5)
#: Factors on the sampling rate; what needs a higher one than usual is tried up to the usual amplitude.
_RATES = (1, 2, 4)
#: Samples per period that a sampling rate must give: with 12 the third harmonic of a delayed force is off by 1 %, which
#: a quiet rig sees.
_FEWEST_SAMPLES = 16
#: Times less probable that a rival is to become.
_ODDS = 10.0
#: Chance to part explanations from which a test does so surely, and the one that it is made long enough for.
_SURE, _AIM = 0.95, 0.98
#: Share of the explanations that the longest test rules out, which is enough where it does not part all surely.
_NEARLY = 0.98
#: Chance from which a test is advised all the same.
_WORTH = 0.5
_STEPS = 8
#: Multiple of the largest measured output past which an answer has run away.
_WILD = 100.0


@dataclass(frozen=True)
class NextTest:
    """A test, and how surely it would separate the explanations that are alike.

    Parameters
    ----------
    kind, frequency, amplitude, duration, rate, conditions
        The procedure: a sine in Hz, in the input's unit, in s, with samples in Hz; conditions that differ from the
        campaign's.
    separation
        Smallest lead over all pairs, in the criterion, that the right explanation is foreseen to gain by it.
    chance
        That one explanation alone is left, all others ten times less probable: expected from how probable they are.
    resolves
        Whether that is sure enough, 0.95.
    parts
        Pairs of explanations that are separated so surely, each by the names of its effects.
    sentence
        In words.
    """

    kind: str
    frequency: float
    amplitude: float
    duration: float
    rate: float
    conditions: Mapping[str, float]
    separation: float
    chance: float
    resolves: bool
    parts: tuple[tuple[str, str], ...]
    sentence: str


def next_test(observed: Observed, alike: Sequence[Explanation]) -> NextTest | None:
    """The sine that leaves the fewest of alike explanations; None if there is nothing to part or no sine to vary.

    How probable they are now counts; another may follow where one test is not enough.
    """
    usual = _usual(observed)
    if len({explanation.effects for explanation in alike}) < 2 or usual is None:
        return None
    procedures = list(_procedures(observed, usual))
    answers = [_answers(observed, explanation.fitted, procedures) for explanation in alike]
    tests = [_foreseen(observed, alike, each, one) for *each, one in zip(*answers, procedures, strict=True)]
    likely = weights(alike)
    shortest = [max(_SECONDS, _PERIODS / float(procedure.frequency or 1)) for procedure in procedures]
    # no more samples at a high rate
    longest = [max(_LONGEST * p.step / usual.step, least) for p, least in zip(procedures, shortest, strict=True)]
    out = [_ruled_out(test, alike, likely, seconds)[1] for test, seconds in zip(tests, longest, strict=True)]
    best = int(np.argmax([likely @ chances.sum(axis=1) for chances in out]))
    procedure, lengths = procedures[best], np.arange(shortest[best], longest[best] + 1, 10.0)
    found = [_ruled_out(tests[best], alike, likely, seconds) for seconds in lengths]
    alone = np.array([likely @ chances.prod(axis=1) for _, chances in found])
    gone = np.array([likely @ (chances * np.isfinite(leads)).sum(axis=1) for leads, chances in found])
    enough = alone >= min(_AIM, alone[-1]) if alone[-1] >= _SURE else gone >= _NEARLY * gone[-1]
    chosen = int(np.argmax(enough))
    (leads, chances), seconds, chance = found[chosen], float(lengths[chosen]), float(alone[chosen])
    names = [" with ".join(explanation.effects) for explanation in alike]
    surely: dict[tuple[str, str], bool] = {}
    for i, j in combinations(range(len(alike)), 2):
        if names[i] != names[j]:
            told = chances[i, j] * likely[i] + chances[j, i] * likely[j] >= _SURE * (likely[i] + likely[j])
            surely[names[i], names[j]] = surely.get((names[i], names[j]), True) and bool(told)
    parted = tuple(pair for pair, told in surely.items() if told)
    conditions = {name: value for name, value in procedure.conditions.items() if value != usual.conditions.get(name)}
    rate = round(1 / procedure.step, 6)
    what = _what(observed, procedure, conditions, seconds, None if procedure.step == usual.step else rate)
    return NextTest(
        kind="sine",
        frequency=float(procedure.frequency or 0),
        amplitude=float(procedure.amplitude or 0),
        duration=seconds,
        rate=rate,
        conditions=conditions,
        separation=float(leads.min()),
        chance=chance,
        resolves=chance >= _SURE,
        parts=parted,
        sentence=_sentence(what, chance, (len(parted), len(surely)), names),
    )


def _ruled_out(test: Foreseen, alike: Sequence[Explanation], likely: Array, seconds: float) -> tuple[Array, Array]:
    """Mean lead, and chance to rule out, by explanation that is right and rival, (k, k)."""
    mean, variance = np.full((2, len(alike), len(alike)), np.inf)
    variance[:] = 1.0
    for right, wrong in permutations(range(len(alike)), 2):
        if alike[right].effects != alike[wrong].effects:
            mean[right, wrong], variance[right, wrong] = test.lead(right, wrong, seconds)
    # what runs away in this test is neither ruled out by it nor rules out
    mean, variance = np.nan_to_num(mean, posinf=np.inf), np.nan_to_num(variance)
    return mean, ruled_out(mean, variance, likely, _ODDS)


def _usual(observed: Observed) -> Procedure | None:
    """The fastest sine that repeats, at the usual speed and with the usual amplitude."""
    driver = first_input(observed.problem.model)
    sines = [
        (record.period, measurement.procedure)
        for measurement, record in zip(observed.problem.measurements, observed.problem.records, strict=True)
        if measurement.kind == "sine" and record.period
    ]
    if not sines:
        return None
    speeds = [sine.conditions.get("longitudinal_velocity", 0.0) for _, sine in sines]
    speed = float(np.quantile(speeds, 0.5, method="nearest"))
    period, sine = min((one for one, own in zip(sines, speeds, strict=True) if own == speed), key=lambda one: one[0])
    amplitude = float(np.median([0.5 * np.ptp(one.inputs[driver]) for _, one in sines]))
    return replace(sine, frequency=1 / period, amplitude=amplitude)


def _procedures(observed: Observed, usual: Procedure) -> Iterator[Procedure]:
    """Sines around the usual one."""
    driver, own = first_input(observed.problem.model), usual.conditions
    speeds = _SPEEDS if "longitudinal_velocity" in own else (1.0,)
    for higher, size, faster in product(_FREQUENCIES, _AMPLITUDES, speeds):
        frequency, amplitude = round(higher * float(usual.frequency or 0), 3), size * float(usual.amplitude or 0)
        rate = next((n for n in _RATES if n >= frequency * usual.step * _FEWEST_SAMPLES), None)
        if rate is None or (rate > 1 and size > 1):
            continue
        step = usual.step / rate
        # as many samples at every rate
        tried = max(min(_SECONDS / usual.step, _SAMPLES), _PERIODS / (frequency * step))
        time = step * np.arange(round(tried), dtype=np.float64)
        speed = {} if faster == 1.0 else {"longitudinal_velocity": round(faster * own["longitudinal_velocity"], 2)}
        yield replace(
            usual,
            name="next",
            time=time,
            inputs={driver: amplitude * np.sin(2 * np.pi * frequency * time)},
            conditions={**own, **speed},
            frequency=frequency,
            amplitude=amplitude,
            start_time=_end(observed) if usual.start_time is not None else None,
        )


def _end(observed: Observed) -> float:
    """When the campaign's last test ended, s since it began."""
    procedures = [m.procedure for m in observed.problem.measurements]
    return max((p.start_time or 0.0) + float(p.time[-1]) for p in procedures)


def _noise(observed: Observed, procedure: Procedure, output: Array) -> float:
    """Variance of a sample: that of the record most like in strength, at the low frequencies that matter.

    A faster sampling is taken to let in more noise, of the same density.
    """
    strength = np.log(np.std(output) + 1e-300)

    def unlike(part: tuple[int, int, Whitening]) -> float:
        channel = observed.problem.model.outputs[part[1]].name
        return abs(float(np.log(np.std(observed.problem.measurements[part[0]].outputs[channel]) + 1e-300) - strength))

    whitening = min((part for part in observed.parts if part[1] == 0), key=unlike)[2]
    level = float(np.median(whitening.process.spectrum[: max(whitening.count // 8, 8)]))
    return level * whitening.step / procedure.step


def _answers(observed: Observed, fitted: Fitted, procedures: Sequence[Procedure]) -> list[tuple[Array, Array]]:
    """Output (n,) and its derivative by the unit coordinates (n, d) in every proposed test; nan where it runs away."""
    model = fitted.hypothesis
    extended = with_effects(observed.problem.model, *model.effects)
    drives = [_drive(observed, extended, procedure) for procedure in procedures]
    _, simulator = observed.workshop.simulator(extended, drives, model.space.names, _STEPS)
    point = fitted.minimum.point
    slope = model.space.slope(model.space.from_unit(point))
    channel = observed.problem.model.outputs[0].name
    peak = max(float(np.max(np.abs(m.outputs[channel]))) for m in observed.problem.measurements)
    found = []
    for procedure, (output, slopes) in zip(procedures, simulator.sensitivities(model.full(point[None])), strict=True):
        settled = procedure.time >= _SETTLING / float(procedure.frequency or 1)
        with np.errstate(over="ignore", invalid="ignore"):
            answer, columns = output[0, settled, 0], slopes[0, settled, 0] * slope
        # an explanation that runs away in a test says nothing of it
        if not np.max(np.abs(output[0, :, 0])) < _WILD * peak:
            answer, columns = np.full_like(answer, np.nan), np.zeros_like(columns)
        found.append((answer, columns))
    return found


def _drive(observed: Observed, model: Model, procedure: Procedure) -> Drive:
    channel = observed.problem.model.outputs[0].name
    # any output will do: it is not looked at
    stand_in = Measurement(procedure, {channel: np.sin(procedure.time)}, observed.problem.measurements[0].units)
    record = Record(None, 0, 0.0, 0.0, {}, "", {})
    return to_drive(model, stand_in, record, settled=False)


def _foreseen(
    observed: Observed,
    alike: Sequence[Explanation],
    answers: Sequence[tuple[Array, Array]],
    procedure: Procedure,
) -> Foreseen:
    """One procedure, linearised at the fits."""
    noise = np.sqrt(_noise(observed, procedure, answers[0][0]))
    free = [explanation.fitted.free for explanation in alike]
    known = []
    for explanation, own in zip(alike, free, strict=True):
        jacobian = explanation.fitted.jacobian[:, own]
        known.append(jacobian.T @ jacobian + np.eye(int(own.sum())))
    slopes = [columns[:, own] / noise for (_, columns), own in zip(answers, free, strict=True)]
    length = float(procedure.time[-1] + procedure.step)
    return foresee([output / noise for output, _ in answers], slopes, known, length)


def _what(
    observed: Observed, procedure: Procedure, conditions: Mapping[str, float], seconds: float, rate: float | None
) -> str:
    """The test in words; the sampling rate where it is not the usual one."""
    driver = first_input(observed.problem.model)
    unit = next(channel.unit for channel in observed.problem.model.inputs if channel.name == driver)
    units = {condition.name: condition.unit for condition in observed.problem.model.conditions}
    under = "".join(f", {n.replace('_', ' ')} {value:g} {units.get(n, '')}".rstrip() for n, value in conditions.items())
    under += "" if rate is None else f", sampled at {rate:g} Hz"
    return f"a sine of {procedure.frequency:g} Hz, amplitude {procedure.amplitude:.4g} {unit}{under}, for {seconds:g} s"


def _sentence(what: str, chance: float, parted: tuple[int, int], names: Sequence[str]) -> str:
    surely, pairs = parted
    if chance >= _SURE:
        return f"Next test: {what}."
    who = " and ".join(dict.fromkeys(names))
    if surely:
        return f"Next test: {what}. It parts {surely} of {pairs} pairs of {who}; diagnose again for the rest."
    if chance >= _WORTH:
        leaves = f"With a chance of {100 * chance:.0f} % it leaves one of {who}"
        return f"Next test: {what}. {leaves}; diagnose again with it."
    best = f"the best of those tried is {what}, with a chance of {100 * chance:.0f} %"
    return f"No sine separates them surely; {best}. Measure or calibrate {who} instead."
