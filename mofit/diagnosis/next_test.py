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
from mofit.drives import first_input, to_drive
from mofit.kernel import Drive
from mofit.model import Model, with_effects
from mofit.signals import Record

Array = NDArray[np.float64]

#: Length of a test that is tried, s, and the longest that is proposed: the noncentrality grows with it.
_SECONDS, _LONGEST = 20.0, 240.0
#: Periods at the start that are not judged.
_SETTLING = 1.0
#: Factors on the largest frequency, on the amplitude, and on the speed of the campaign that are tried.
_FREQUENCIES, _AMPLITUDES, _SPEEDS = (0.5, 1.0, 1.5, 2.0), (0.5, 1.0, 2.0), (1 / 3, 1.0)
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
    sentence: str


def next_test(observed: Observed, alike: Sequence[Explanation]) -> NextTest | None:
    """The sine that separates alike explanations best; None if there is nothing to separate or no sine to vary."""
    procedures = list(_procedures(observed))
    if len(alike) < 2 or not procedures:
        return None
    answers = [_answers(observed, explanation.fitted, procedures) for explanation in alike]
    noise = _noise(observed)
    separation = np.full(len(procedures), np.inf)
    for first, second in combinations(range(len(alike)), 2):
        if alike[first].effects != alike[second].effects:
            for pair in ((first, second), (second, first)):
                separation = np.minimum(separation, _separations(answers, alike, pair, noise))
    best = int(np.argmax(separation))
    procedure, largest = procedures[best], float(separation[best])
    # of the test that was varied: phases of what turns, say, are those of a record
    usual = max(procedures, key=lambda one: one.conditions.get("longitudinal_velocity", 0.0)).conditions
    conditions = {name: value for name, value in procedure.conditions.items() if value != usual.get(name)}
    # rounded up to whole tens of seconds
    seconds = float(np.clip(np.ceil(0.1 * _SECONDS * SEPARATES / max(largest, 1e-9)) * 10, _SECONDS, _LONGEST))
    largest *= seconds / _SECONDS
    return NextTest(
        kind="sine",
        frequency=float(procedure.frequency or 0),
        amplitude=float(procedure.amplitude or 0),
        duration=seconds,
        conditions=conditions,
        separation=largest,
        resolves=largest >= SEPARATES,
        sentence=_sentence(observed, procedure, conditions, seconds, largest, alike),
    )


def _procedures(observed: Observed) -> Iterator[Procedure]:
    """Sines around those of the campaign."""
    sines = [m.procedure for m in observed.problem.measurements if m.kind == "sine"]
    periods = [r.period for m, r in zip(observed.problem.measurements, observed.problem.records, strict=True)
               if m.kind == "sine" and r.period]  # fmt: skip
    if not sines or not periods:
        return
    model = sines[int(np.argmin(periods))]
    driver = first_input(observed.problem.model)
    amplitude = max(float(np.ptp(sine.inputs[driver])) / 2 for sine in sines)
    speeds = _SPEEDS if "longitudinal_velocity" in model.conditions else (1.0,)
    time = np.arange(round(_SECONDS / model.step), dtype=np.float64) * np.float64(model.step)
    for factor in _FREQUENCIES:
        frequency = round(factor / min(periods), 3)
        if frequency * model.step * _FEWEST_SAMPLES > 1:
            continue
        for size in _AMPLITUDES:
            for slower in speeds:
                conditions = dict(model.conditions)
                if slower != 1.0:
                    conditions["longitudinal_velocity"] = round(slower * conditions["longitudinal_velocity"], 2)
                yield replace(
                    model,
                    name="next",
                    time=time,
                    inputs={driver: size * amplitude * np.sin(2 * np.pi * frequency * time)},
                    conditions=conditions,
                    frequency=frequency,
                    amplitude=size * amplitude,
                    start_time=_end(observed) if model.start_time is not None else None,
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
    separation: float,
    alike: Sequence[Explanation],
) -> str:
    driver = first_input(observed.problem.model)
    unit = next(channel.unit for channel in observed.problem.model.inputs if channel.name == driver)
    under = "".join(f", {name.replace('_', ' ')} {value:g}" for name, value in conditions.items())
    what = f"a sine of {procedure.frequency:g} Hz, amplitude {procedure.amplitude:.4g} {unit}{under}, for {seconds:g} s"
    if separation >= SEPARATES:
        return f"Next test: {what}."
    names = " and ".join(dict.fromkeys(name for explanation in alike for name in explanation.effects))
    return f"No sine separates them surely; the best of those tried is {what}. Measure or calibrate {names} instead."
