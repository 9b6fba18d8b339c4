"""What a rig declares, and the integrator: Runge-Kutta of order four over many tests (lanes) at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from other_rigs_cases.element import Element
from other_rigs_cases.excitation import PERIODS, STEP, Test, grid, lead

#: parameters of the rig; one value per lane
Values = Mapping[str, Any]


@dataclass(frozen=True)
class Motion:
    """Output, deflection and its rate at every step, (steps, lanes), in units of the rig."""

    output: FloatArray
    deflection: FloatArray
    rate: FloatArray


@dataclass(frozen=True)
class Drive:
    """Input and its rate at every half step, (2 steps - 1, lanes), and what else differs between lanes."""

    u: FloatArray
    v: FloatArray
    time: FloatArray
    """Since the first sample, at every half step, (2 steps - 1, 1)."""
    clock: FloatArray
    """Time since the campaign began, at every half step."""
    speed: FloatArray
    angle: FloatArray


@dataclass(frozen=True)
class Units:
    """SI units of a drawn rig: of input, output and time."""

    input: float
    output: float
    time: float


@dataclass(frozen=True)
class Rig:
    """A rig, and the model that its user has."""

    name: str
    title: str
    input: tuple[str, str]
    output: tuple[str, str]
    draw: Callable[[np.random.Generator], dict[str, float]]
    """Values in units of the rig."""
    units: Callable[[np.random.Generator], Units]
    respond: Callable[[Values, Element, Drive, Mapping[str, float]], Motion]
    stiffness: str
    """Value that is the stiffness of the deflection."""
    model: str = ""
    """A shipped model; empty where ``source`` writes a file."""
    source: Callable[[Mapping[str, float], Units, np.random.Generator], str] | None = None
    rolling: bool = False
    periods: int = PERIODS
    """Of its multisines: the fewer, the denser are their lines."""
    conditions: Mapping[str, tuple[float, str]] = field(default_factory=dict)


def drive_of(tests: Sequence[Test]) -> Drive:
    """The tests side by side."""
    time = grid(lead(tests))
    pairs = [test.drive(time) for test in tests]
    u, v = (np.stack(one, axis=1) for one in zip(*pairs, strict=True))
    clock = time[:, None] + np.array([test.start for test in tests])
    return Drive(u, v, time[:, None], clock, np.array([t.speed for t in tests]), np.array([t.angle for t in tests]))


def integrate(rates: Callable[[int, FloatArray], FloatArray], start: FloatArray, halves: int) -> FloatArray:
    """States at every step, (steps, states, lanes), from their rates at a half step and state."""
    found = np.empty((halves // 2 + 1, *start.shape))
    found[0] = z = start
    for n in range(halves // 2):
        now = 2 * n
        first = rates(now, z)
        second = rates(now + 1, z + STEP / 2 * first)
        third = rates(now + 1, z + STEP / 2 * second)
        fourth = rates(now + 2, z + STEP * third)
        found[n + 1] = z = z + STEP / 6 * (first + 2 * (second + third) + fourth)
    return found


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(low * (high / low) ** rng.random())
