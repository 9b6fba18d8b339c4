"""The test that would tell alike explanations apart, or that none of those tried can."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Measurement, Procedure
from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.refit import Explanation
from mofit.diagnosis.verdict import weights
from mofit.drives import first_input, to_drive
from mofit.kernel import Drive
from mofit.model import Model, with_effects
from mofit.signals import Record

Array = NDArray[np.float64]

#: Length of a test that is tried, s, and the longest that is proposed: the noncentrality grows with it.
_SECONDS, _LONGEST = 20.0, 240.0
#: Periods at the start that are not judged.
_SETTLING = 1.0
#: Factors on the largest frequency, on the usual amplitude, and on the usual speed of the campaign that are tried.
_FREQUENCIES, _AMPLITUDES, _SPEEDS = (0.125, 0.5, 1.0, 1.5, 2.0), (0.5, 1.0, 2.0, 3.0), (1 / 3, 1.0)
#: Noncentrality from which a test separates surely: with 40 the criteria differ by 4.6 in more than 97 of 100 cases,
#: and what is foreseen from an effect of score 50 is uncertain by a third of it and more.
SEPARATES = 100.0
#: Samples per period that a sampling rate must give: with 12 the third harmonic of a delayed force is off by 1 %, which
#: a quiet rig sees.
_FEWEST_SAMPLES = 16
_STEPS = 8
#: Multiple of the largest measured output past which an answer has run away.
_WILD = 100.0


@dataclass(frozen=True)
class NextTest:
    """A test, and how surely it would separate the explanations that are alike.

    Parameters
    ----------
    kind, frequency, amplitude, duration, conditions
        The procedure: a sine in Hz, in the input's unit, and in s; conditions that differ from the campaign's.
    separation
        Smallest noncentrality over all pairs, with this test added to those there are.
    resolves
        Whether that is enough.
    parts
        Pairs of explanations that are separated surely, each by the names of its effects.
    sentence
        In words.
    """

    kind: str
    frequency: float
    amplitude: float
    duration: float
    conditions: Mapping[str, float]
    separation: float
    resolves: bool
    parts: tuple[tuple[str, str], ...]
    sentence: str


def next_test(observed: Observed, alike: Sequence[Explanation]) -> NextTest | None:
    """The sine that separates alike explanations best; None if there is nothing to separate or no sine to vary.

    Where no sine separates all of them, the one that separates most, by how probable they are: others may follow it.
    """
    usual = _usual(observed)
    pairs = [pair for pair in combinations(range(len(alike)), 2) if alike[pair[0]].effects != alike[pair[1]].effects]
    if not pairs or usual is None:
        return None
    procedures = list(_procedures(observed, usual))
    answers, noise = [_answers(observed, explanation.fitted, procedures) for explanation in alike], _noise(observed)
    # per pair and procedure, over the seconds tried
    separations = np.array(
        [np.minimum(*(_separations(answers, alike, one, noise) for one in (pair, pair[::-1]))) for pair in pairs]
    )
    likely = weights(alike)
    best = _best(separations, np.array([likely[first] * likely[second] for first, second in pairs]))
    procedure, here = procedures[best], separations[:, best]
    needed = _SECONDS * SEPARATES / np.maximum(here, 1e-9)
    within = needed[needed <= _LONGEST]
    # rounded up to whole tens of seconds
    seconds = float(np.clip(np.ceil(0.1 * within.max()) * 10, _SECONDS, _LONGEST)) if len(within) else _LONGEST
    here = here * seconds / _SECONDS
    names = [" with ".join(explanation.effects) for explanation in alike]
    parts = tuple((names[i], names[j]) for (i, j), value in zip(pairs, here, strict=True) if value >= SEPARATES)
    conditions = {name: value for name, value in procedure.conditions.items() if value != usual.conditions.get(name)}
    return NextTest(
        kind="sine",
        frequency=float(procedure.frequency or 0),
        amplitude=float(procedure.amplitude or 0),
        duration=seconds,
        conditions=conditions,
        separation=float(here.min()),
        resolves=len(parts) == len(pairs),
        parts=parts,
        sentence=_sentence(observed, procedure, conditions, seconds, (len(parts), len(pairs)), names),
    )


def _best(separations: Array, weight: Array) -> int:
    """Index of the procedure for separations (pairs, procedures), with a weight (pairs,) for each pair."""
    smallest, enough = separations.min(axis=0), SEPARATES * _SECONDS / _LONGEST
    if smallest.max() >= enough:
        return int(np.argmax(smallest))
    return int(np.argmax(weight @ np.minimum(separations / enough, 1.0)))


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
    driver = first_input(observed.problem.model)
    speeds = _SPEEDS if "longitudinal_velocity" in usual.conditions else (1.0,)
    time = np.arange(round(_SECONDS / usual.step), dtype=np.float64) * np.float64(usual.step)
    for factor in _FREQUENCIES:
        frequency = round(factor * float(usual.frequency or 0), 3)
        if frequency * usual.step * _FEWEST_SAMPLES > 1:
            continue
        for size in _AMPLITUDES:
            for slower in speeds:
                conditions = dict(usual.conditions)
                if slower != 1.0:
                    conditions["longitudinal_velocity"] = round(slower * conditions["longitudinal_velocity"], 2)
                amplitude = size * float(usual.amplitude or 0)
                yield replace(
                    usual,
                    name="next",
                    time=time,
                    inputs={driver: amplitude * np.sin(2 * np.pi * frequency * time)},
                    conditions=conditions,
                    frequency=frequency,
                    amplitude=amplitude,
                    start_time=_end(observed) if usual.start_time is not None else None,
                )


def _end(observed: Observed) -> float:
    """When the campaign's last test ended, s since it began."""
    procedures = [m.procedure for m in observed.problem.measurements]
    return max((p.start_time or 0.0) + float(p.time[-1]) for p in procedures)


def _noise(observed: Observed) -> float:
    """Variance of a sample of white noise of the level at the low frequencies that matter."""
    return float(np.median([np.median(w.process.spectrum[: max(w.count // 8, 8)]) for _, _, w in observed.parts]))


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


def _separations(
    answers: Sequence[list[tuple[Array, Array]]], alike: Sequence[Explanation], pair: tuple[int, int], noise: float
) -> Array:
    r"""Noncentrality of every proposed test if the first of the pair is right and the second is fitted.

    .. math:: \lambda = \min_\delta \; |y_k - y_l - J_l \delta|^2 / \sigma^2 + \delta^T H_l \delta

    with the Hessian of the tests there are: T-optimality (Atkinson & Fedorov 1975), linearised at the fits.
    """
    right, wrong = pair
    free = alike[wrong].fitted.free
    jacobian = alike[wrong].fitted.jacobian[:, free]
    normal = jacobian.T @ jacobian + np.eye(int(free.sum()))
    found = []
    for (truth, _), (output, slopes) in zip(answers[right], answers[wrong], strict=True):
        difference, columns = (truth - output) / np.sqrt(noise), slopes[:, free] / np.sqrt(noise)
        pull = columns.T @ difference
        found.append(float(difference @ difference - pull @ np.linalg.solve(columns.T @ columns + normal, pull)))
    return np.nan_to_num(found)


def _sentence(
    observed: Observed,
    procedure: Procedure,
    conditions: Mapping[str, float],
    seconds: float,
    parted: tuple[int, int],
    names: Sequence[str],
) -> str:
    driver = first_input(observed.problem.model)
    unit = next(channel.unit for channel in observed.problem.model.inputs if channel.name == driver)
    units = {condition.name: condition.unit for condition in observed.problem.model.conditions}
    under = "".join(f", {n.replace('_', ' ')} {value:g} {units.get(n, '')}".rstrip() for n, value in conditions.items())
    what = f"a sine of {procedure.frequency:g} Hz, amplitude {procedure.amplitude:.4g} {unit}{under}, for {seconds:g} s"
    surely, pairs = parted
    if surely == pairs:
        return f"Next test: {what}."
    who = " and ".join(dict.fromkeys(names))
    if surely:
        return f"Next test: {what}. It parts {surely} of {pairs} pairs of {who}; diagnose again for the rest."
    return f"No sine separates them surely; the best of those tried is {what}. Measure or calibrate {who} instead."
