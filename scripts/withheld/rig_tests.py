"""The test plan: the paper's Table 1, as the rig runs it, sines at large angles and fast ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FREQUENCIES = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
SPEED, LOAD, WHEEL_RADIUS, DRUM_RADIUS = 60 / 3.6, 3600.0, 0.305, 0.61
#: sines besides the paper's nine: frequency [Hz], amplitude [deg], speed [m/s]
FURTHER = ((4.0, 8.0, 10.0), (4.0, 8.0, SPEED), (6.0, 8.0, 10.0), (16.0, 2.0, 25.0), (20.0, 2.0, 25.0))
RATE, SLOW_RATE = 100.0, 20.0
#: a sine of which RATE takes fewer samples per period is sampled faster, and for half as long
FEWEST, FAST_RATE, FURTHER_DURATION = 12, 400.0, 10.0
DELAY, RAMP = 0.5, np.deg2rad(40.0)
STROKE, STROKE_SPEED = 0.02, 2e-3


@dataclass(frozen=True)
class RigTest:
    """One test, SI units. ``kind``: sine, step or quasi_static. Phases: of wheel and drum at the first sample."""

    name: str
    kind: str
    duration: float
    amplitude: float
    frequency: float | None = None
    rate: float = RATE
    speed: float = SPEED
    start_time: float | None = None
    wheel_phase: float = 0.0
    drum_phase: float = 0.0

    @property
    def time(self) -> Array:
        """Of the samples, s."""
        return np.arange(round(self.duration * self.rate) + (self.kind == "quasi_static")) / self.rate

    def command(self, time: Array) -> Array:
        """Input as it is driven at any time: slip angle [rad], quasi-static displacement [m]."""
        if self.kind == "sine":
            return self.amplitude * np.sin(2 * np.pi * self.frequency * time)
        if self.kind == "step":
            return np.sign(self.amplitude) * np.clip((time - DELAY) * RAMP, 0, abs(self.amplitude))
        corners = self.duration * np.array([0, 0.25, 0.75, 1.0])
        return np.interp(time, corners, self.amplitude * np.array([0.0, 1.0, -1.0, 0.0]))


def sine(frequency: float, amplitude: float = np.deg2rad(2.0), **rest: float) -> RigTest:
    """A sine of 20 periods or 20 s, whichever is shorter."""
    label = f"sine_{frequency:.2f}Hz".replace(".", "_")
    return RigTest(label, "sine", min(20 / frequency, 20.0), amplitude, frequency, **rest)


def further_sine(frequency: float, amplitude: float, speed: float) -> RigTest:
    """A sine besides the paper's, with an amplitude in deg."""
    fast = FEWEST * frequency > RATE
    return replace(
        sine(frequency, float(np.deg2rad(amplitude)), speed=speed),
        name=f"sine_{frequency:.2f}Hz_{amplitude:.0f}deg_{3.6 * speed:.0f}kmh".replace(".", "_"),
        rate=FAST_RATE if fast else RATE,
        duration=FURTHER_DURATION / 2 if fast else FURTHER_DURATION,
    )


def planned_tests(rng: np.random.Generator, paper: bool = False) -> tuple[RigTest, ...]:
    """Three steps, one quasi-static test, nine sines, and those besides unless ``paper``.

    The sines are one day's campaign in random order, with pauses; their clock starts with the first of them. Steps and
    quasi-static test belong to another day and have no start time.
    """
    steps = [RigTest(f"step_{d}deg", "step", 60.0, np.deg2rad(d)) for d in (1, 2, 4)]
    slow = RigTest("quasi_static", "quasi_static", 4 * STROKE / STROKE_SPEED, STROKE, rate=SLOW_RATE)
    sines, clock = [sine(f) for f in FREQUENCIES] + [further_sine(*of) for of in FURTHER if not paper], 0.0
    for i in rng.permutation(len(sines)):
        sines[i] = replace(sines[i], start_time=round(clock, 2))
        clock += sines[i].duration + rng.uniform(20, 60)
    rolling = [replace(t, **phases(rng)) for t in (*steps, *sines)]
    return (*rolling[:3], slow, *rolling[3:])


def phases(rng: np.random.Generator) -> dict[str, float]:
    """Where wheel and drum stand at the first sample."""
    return dict(zip(("wheel_phase", "drum_phase"), np.round(rng.uniform(0, 2 * np.pi, 2), 4).tolist(), strict=True))
