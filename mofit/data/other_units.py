r"""Tests whose size, beside the other tests of a campaign, is that of another unit.

The range :math:`Y` of an output follows from that of the input, :math:`X`, from the frequency and from what else tells
two tests apart,

.. math:: \ln Y = a + b \ln f + c \ln X + \ldots \pm s,

with slopes that are those of physics a priori: a gain grows with a power of the frequency of about -1 to 1, an output
is proportional to its input or saturates. All but one test tell the slopes and the scatter :math:`s`, and with them
what the range of that one should be, so that neither a test at the highest frequency nor one of another amplitude
looks wrong. Then every unit that people use for the channel is tried: how much likelier is the test if that unit was
confused with the one stated? The input is taken as any setting within some factor of those of the other tests. The
most telling test is corrected before the others are looked at again, as it would spoil what they are compared with.

References
----------
Bishop, "Pattern Recognition and Machine Learning" (2006), section 3.3.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Measurement
from mofit.data.signals import SignalAnalysis
from mofit.errors import Issue


@dataclass(frozen=True)
class SizeSettings:
    """Settings of `other_unit_issues`, each with its reason."""

    likelier: float = 300.0
    """Times as likely as without: an error of this kind is one of some hundred tests, and several units are tried."""
    power: float = 1.0
    """Standard deviation of the power of the frequency: a damper has 1, a mass 2, a spring 0."""
    proportion: tuple[float, float] = (0.7, 0.4)
    """Mean and standard deviation of the power of the input: 1 where linear, 0 where saturated."""
    other: float = 1.0
    """Standard deviation of the logarithm per kind of excitation, and over the range of a condition."""
    level: float = 30.0
    """Of the logarithm of the output: any."""
    scatter: float = 0.25
    """Scatter of the logarithm before data tell more: settings that nobody wrote down."""
    worth: float = 2.0
    """Number of tests that this knowledge is worth."""
    rounds: int = 20
    """Rounds of weights, scatter and slopes."""
    setting: float = 1.0
    """Least standard deviation of the logarithm of the input, as rigs are set to one stroke or to several."""


SETTINGS = SizeSettings()
#: units that people use by SI unit, and how many of that one is; constants, as the registry of units takes long to load
USUAL_UNITS: Mapping[str, Mapping[str, float]] = {
    "N": {"kN": 1e3, "lbf": 4.4482216152605, "kgf": 9.80665},
    "N m": {"kN m": 1e3, "N mm": 1e-3, "kgf m": 9.80665},
    "m": {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254},
    "rad": {"deg": math.pi / 180, "mrad": 1e-3},
    "Pa": {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "psi": 6894.757293168},
    "1": {"percent": 1e-2, "mm/m": 1e-3},
    "m/s": {"mm/s": 1e-3, "km/h": 1 / 3.6},
    "V": {"mV": 1e-3},
    "A": {"mA": 1e-3},
}


@dataclass(frozen=True)
class _Test:
    """Logarithms of the ranges of its input and its output, and what tells it from others."""

    name: str
    output: float
    input: float
    frequency: float | None
    kind: str
    conditions: Mapping[str, float]


@dataclass(frozen=True)
class _Fault:
    """A channel, the unit that its values have, the unit that was stated, and by how much that moves the logarithm."""

    channel: str
    unit: str
    stated: str
    moved: float


def other_unit_issues(measurements: Sequence[Measurement], analyses: Mapping[str, SignalAnalysis]) -> Iterator[Issue]:
    """A warning per test and channel that is likelier in another unit; ``analyses`` are by test."""
    groups: dict[tuple[str, str], list[_Test]] = {}
    units: dict[str, str] = {}
    for measurement in measurements:
        units.update(measurement.units)
        driver, size = _moving_input(measurement)
        found = analyses[measurement.name].period if measurement.kind == "sine" else None
        for output, values in measurement.outputs.items():
            if (moved := float(np.ptp(values))) > 0:
                test = _Test(
                    measurement.name,
                    math.log(moved),
                    math.log(size),
                    None if found is None else -math.log(found),
                    measurement.kind,
                    measurement.experiment.conditions,
                )
                groups.setdefault((driver, output), []).append(test)
    said: set[str] = set()
    for (driver, output), tests in groups.items():
        faults = [fault for name in (output, driver) if name for fault in _faults(name, units.get(name, "1"))]
        for issue in _faulty(tests, faults, output, bool(driver)):
            if issue.where not in said:
                said.add(issue.where)
                yield issue


def _moving_input(measurement: Measurement) -> tuple[str, float]:
    """The first input that moves, and its range; no name and 1 where none does."""
    for name, values in measurement.experiment.inputs.items():
        if (size := float(np.ptp(values))) > 0:
            return name, size
    return "", 1.0


def _faults(channel: str, stated: str) -> list[_Fault]:
    """Every confusion of the SI unit of a channel with one that people use."""
    faults = []
    for unit, size in USUAL_UNITS.get(stated, {}).items():
        faults += [
            _Fault(channel, unit, stated, -math.log(size)),
            _Fault(channel, stated, unit, math.log(size)),
        ]
    return faults


def _faulty(tests: list[_Test], faults: Sequence[_Fault], output: str, driven: bool) -> Iterator[Issue]:
    """A warning per test that is likelier with a fault, the most telling first; of two tests one for both."""
    original = list(tests)
    for _ in range(len(tests) if len(tests) > 2 else len(tests) - 1):
        features = _features(tests, driven)
        gain, at, fault = max(_likeliest(tests, features, at, faults, output) for at in range(len(tests)))
        if gain < math.log(SETTINGS.likelier):
            return
        own, found = tests[at], faults[fault]
        of_output = found.channel == output
        tests[at] = replace(
            own,
            output=own.output - (found.moved if of_output else 0.0),
            input=own.input - (0.0 if of_output else found.moved),
        )
        yield _issue(original if len(tests) == 2 else [original[at]], tests[at], found, of_output)


def _features(tests: Sequence[_Test], driven: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the logarithm of the output is linear in, shape (n, p), with mean and standard deviation of every slope.

    The second column is the logarithm of the input.
    """
    known = [test.frequency for test in tests if test.frequency is not None]
    middle = float(np.mean(known)) if known else 0.0
    usual = Counter(test.kind for test in tests).most_common(1)[0][0]
    columns = [np.ones(len(tests)), np.array([test.input for test in tests])]
    columns.append(np.array([0.0 if test.frequency is None else test.frequency - middle for test in tests]))
    mean, spread = SETTINGS.proportion
    means, spreads = [0.0, mean, 0.0], [SETTINGS.level, spread if driven else 1e-6, SETTINGS.power]
    for kind in sorted({test.kind for test in tests} - {usual}):
        columns.append(np.array([float(test.kind == kind) for test in tests]))
    for name in sorted({name for test in tests for name in test.conditions}):
        values = np.array([test.conditions.get(name, np.nan) for test in tests])
        values = np.where(np.isfinite(values), values, np.nanmean(values))
        if np.ptp(values) > 1e-3 * np.max(np.abs(values)):
            columns.append((values - values.mean()) / np.ptp(values))
    more = len(columns) - len(means)
    return np.column_stack(columns), np.array([*means, *[0.0] * more]), np.array([*spreads, *[SETTINGS.other] * more])


def _likeliest(
    tests: Sequence[_Test], features: tuple[FloatArray, FloatArray, FloatArray], at: int, faults: Sequence[_Fault],
    output: str,
) -> tuple[float, int, int]:  # fmt: skip
    """By how much the logarithm of the likelihood of a test grows with its likeliest fault, the test, and the fault."""
    design, mean, spread = features
    others = np.arange(len(tests)) != at
    sizes = np.array([test.output for test in tests])
    slopes, cover, scatter = _regression(design[others], sizes[others] - design[others] @ mean, spread)
    settings = design[others, 1]
    middle, width = float(np.mean(settings)), max(float(np.std(settings)), SETTINGS.setting)
    tail = SETTINGS.worth + len(tests) - 1

    def likelihood(input_moved: float, output_moved: float) -> float:
        """Logarithm, but for a constant, if the true sizes are less by so much."""
        row = design[at].copy()
        row[1] -= input_moved
        gap = sizes[at] - output_moved - float(row @ (mean + slopes))
        return _student(gap, scatter**2 + float(row @ cover @ row), tail) + _student(row[1] - middle, width**2, tail)

    plain = likelihood(0.0, 0.0)
    moved = [(0.0, fault.moved) if fault.channel == output else (fault.moved, 0.0) for fault in faults]
    return max(((likelihood(*sizes) - plain, at, k) for k, sizes in enumerate(moved)), default=(0.0, at, 0))


def _regression(design: FloatArray, sizes: FloatArray, spread: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Slopes beyond their prior means, shape (p,), their covariance (p, p), and the scatter of a test.

    Tests far from the others count little (Student's scatter, reweighted): they may be in another unit, too.
    """
    scatter, left = SETTINGS.scatter, sizes - np.median(sizes)
    for _ in range(SETTINGS.rounds):
        weight = (SETTINGS.worth + 1) / (SETTINGS.worth + (left / scatter) ** 2)
        weighted = design * weight[:, None]
        cover = np.asarray(np.linalg.inv(design.T @ weighted / scatter**2 + np.diag(spread**-2)), dtype=float)
        slopes = cover @ (weighted.T @ sizes) / scatter**2
        # of a test that the others tell, so that as many slopes as tests do not look exact
        free = 1 - weight * np.einsum("ij,jk,ik->i", design, cover, design) / scatter**2
        left = (sizes - design @ slopes) / np.sqrt(np.maximum(free, 1e-6))
        total = SETTINGS.worth * SETTINGS.scatter**2 + float(np.sum(np.minimum(weight, 1.0) * left**2))
        scatter = math.sqrt(total / (SETTINGS.worth + len(sizes)))
    return slopes, cover, scatter


def _student(gap: float, variance: float, tail: float) -> float:
    """Logarithm of Student's density with ``tail`` degrees of freedom, but for a constant."""
    return -0.5 * math.log(variance) - 0.5 * (tail + 1) * math.log1p(gap**2 / variance / tail)


def _issue(tests: Sequence[_Test], corrected: _Test, fault: _Fault, of_output: bool) -> Issue:
    sizes = [math.exp(test.output if of_output else test.input) for test in tests]
    if len(tests) == 1:
        expected = math.exp(corrected.output if of_output else corrected.input)
        message = (
            f"its range is {sizes[0]:.3g}, the other tests let expect about {expected:.3g}, "
            f"as if in another unit: {fault.unit} read as {fault.stated}"
        )
        hint = f"give the channel unit = '{fault.unit}' in the map of this test"
    else:
        units = f"one of them in {fault.unit}, the other in {fault.stated}"
        message = f"its ranges are {sizes[0]:.3g} and {sizes[1]:.3g}, as if in another unit: {units}"
        hint = "give each channel its own unit in the map"
    names = " and ".join(f"'{test.name}'" for test in tests)
    where = f"group{'s' if len(tests) > 1 else ''} {names}, variable '{fault.channel}'"
    return Issue(where, message, f"If the unit is wrong and not the record, {hint}", "warning")
