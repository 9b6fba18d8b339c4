"""Tests in units of the rig: an angular frequency of 1 is its own, an amplitude of 1 the largest of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray

KINDS = ("sine", "chirp", "free", "multisine")
#: of every record: cycles of the rig's own frequency, samples, integration steps per sample
CYCLES, COUNT, FINE = 20, 1000, 6
#: samples before the record, for delays and filters; and those in which a rig settles besides
BEFORE, SETTLING = 30, 1000
SAMPLE = 2 * np.pi * CYCLES / COUNT
STEP = SAMPLE / FINE
#: cycles per record of the sines, amplitudes of all kinds
SINES, AMPLITUDES = (6, 12, 20, 30, 40, 56), (1.0, 0.5, 0.8, 0.35, 0.9, 0.6)
TESTS = {"sine": 6, "chirp": 4, "free": 4, "multisine": 4}
#: range of the chirps and of the road, relative to the rig's own frequency, which a multisine ends at as well; periods
#: of a multisine
LOW, HIGH, PERIODS = 0.2, 3.0, 4
#: time over which chirps and road rise from rest
RISE = 2 * np.pi
#: pause between two tests, in lengths of a record
PAUSES = (0.5, 2.0)
#: another kind of excitation than the campaign's, for tests held out
OTHER = {"sine": "free", "chirp": "free", "free": "chirp", "multisine": "chirp"}


@dataclass(frozen=True, eq=False)
class Test:
    """One test: a sum of sines of given frequencies and phases, or a sweep."""

    name: str
    kind: str
    amplitude: float
    frequencies: FloatArray
    phases: FloatArray
    sizes: FloatArray
    start: float = 0.0
    speed: float = 1.0
    """Of a rolling tyre, relative to the usual one."""
    angle: float = 0.0
    """Of what rotates, at the first sample."""
    settled: bool = False
    """Whether it runs a while before the record; else nothing moves before it."""

    def drive(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Input and its rate at any time."""
        if self.kind == "step":
            rising = (time > 0) & (time < self.amplitude * RISE)
            return np.clip(time / RISE, 0, self.amplitude), rising / RISE
        if self.kind == "chirp":
            low, high = self.frequencies
            swept = low * time + (high - low) * time**2 / 2 / (SAMPLE * COUNT)
            u, v = np.sin(swept), np.cos(swept) * (low + (high - low) * time / (SAMPLE * COUNT))
        else:
            turned = self.frequencies[:, None] * time + self.phases[:, None]
            u, v = self.sizes @ np.sin(turned), (self.sizes * self.frequencies) @ np.cos(turned)
        begun = np.clip(time / RISE, 0, 1)
        rise, rate = begun**2 * (3 - 2 * begun), 6 * begun * (1 - begun) / RISE
        if self.kind in ("sine", "multisine"):  # these begin at zero, and repeat within the time of settling
            rise, rate = np.heaviside(time + SETTLING * SAMPLE * self.settled, 1.0), np.zeros_like(time)
        return self.amplitude * rise * u, self.amplitude * (rise * v + rate * u)


def lead(tests: Sequence[Test]) -> int:
    """Samples before the records of tests that are simulated side by side."""
    return BEFORE + SETTLING * any(test.settled for test in tests)


def grid(before: int) -> FloatArray:
    """Times of the integration's half steps; the record's first sample is at zero."""
    halves = 2 * FINE * (before + COUNT - 1) + 1
    return (np.arange(halves) - 2 * FINE * before) * STEP / 2


def make(
    rng: np.random.Generator,
    name: str,
    kind: str,
    amplitude: float,
    cycles: int = 0,
    speed: float = 1.0,
    periods: int = PERIODS,
) -> Test:
    """One test with random phases; a multisine of so many periods excites all lines up to the highest."""
    if kind == "sine":
        lines, sizes = np.array([cycles / CYCLES]), np.ones(1)
    elif kind == "chirp":
        return Test(name, kind, amplitude, rng.permutation([LOW, HIGH]), np.zeros(2), np.ones(2), speed=speed)
    elif kind == "step":
        lines, sizes = np.ones(1), np.ones(1)
    elif kind == "multisine":
        lines = np.arange(1, round(HIGH * CYCLES / periods) + 1) * periods / CYCLES
        sizes = np.ones(len(lines))
    else:  # lines so dense that nothing repeats
        lines = np.arange(1, 90) * HIGH / 90 + 1e-3 * rng.random(89)
        sizes = 1 / (0.3 + lines)
    test = Test(name, kind, amplitude, lines, rng.uniform(0, 2 * np.pi, len(lines)), sizes, speed=speed)
    if kind == "sine":
        return replace(test, phases=np.zeros(1))
    time = np.arange(COUNT) * SAMPLE
    u = test.sizes @ np.sin(lines[:, None] * time + test.phases[:, None])
    if kind == "multisine":
        test = replace(test, phases=test.phases + lines * _upward(test, u))
    return replace(test, sizes=sizes / np.abs(u).max())


def _upward(test: Test, u: FloatArray) -> float:
    """A time at which a periodic signal passes zero, by bisection."""
    first = int(np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))[0])
    low, high = first * SAMPLE, (first + 1) * SAMPLE
    for _ in range(60):
        middle = 0.5 * (low + high)
        value = float(test.sizes @ np.sin(test.frequencies * middle + test.phases))
        low, high = (middle, high) if value < 0 else (low, middle)
    return low


def planned(rng: np.random.Generator, kind: str, rolling: bool, settled: bool, periods: int = PERIODS) -> list[Test]:
    """The tests of a campaign in random order with pauses; a rolling tyre at two speeds, with steps on another day."""
    amplitudes = rng.permutation(AMPLITUDES[: TESTS[kind]])
    tests = [
        make(rng, f"{kind}_{k + 1}", kind, amplitude, SINES[k], 0.6 if rolling and k % 2 else 1.0, periods)
        for k, amplitude in enumerate(amplitudes)
    ]
    tests = [replace(test, settled=settled) for test in tests]
    return timed(rng, tests) + [
        make(rng, f"step_{k + 1}", "step", size) for k, size in enumerate((0.2, 0.5, 1.0)) if rolling
    ]


def timed(rng: np.random.Generator, tests: Sequence[Test]) -> list[Test]:
    """The tests with start times in random order, and an angle of what rotates."""
    clock, found = 0.0, {}
    for k in rng.permutation(len(tests)):
        found[int(k)] = replace(tests[k], start=clock, angle=float(rng.uniform(0, 2 * np.pi)))
        clock += SAMPLE * COUNT * (1 + rng.uniform(*PAUSES))
    return [found[k] for k in range(len(tests))]


def held_out(rng: np.random.Generator, kind: str, settled: bool, periods: int = PERIODS) -> list[Test]:
    """Tests that no fit sees: of the same kind, larger, of another kind; and one more of another, to be given."""
    tests = [make(rng, f"same_{k + 1}", kind, 0.7, (16, 34)[k], periods=periods) for k in range(2)]
    tests.append(make(rng, "group_1", kind, 1.25, 40, periods=periods))
    tests = [replace(test, settled=settled) for test in tests]
    tests += [make(rng, name, OTHER[kind], 0.8) for name in ("other_1", "given_1")]
    return timed(rng, tests)
