"""The independent simulator: excitations as functions of time, and the truth's response by scipy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from systems.family import Draw, Family, Values

#: Relative tolerance of the integrator, far below the noise.
TOLERANCE = 1e-9
SINE_SAMPLES, SINE_PERIODS = 80, 6
OTHER_SAMPLES = 600


@dataclass(frozen=True)
class Excitation:
    """One test: its input and the input's rate as functions of time."""

    name: str
    kind: str
    time: np.ndarray
    value: Callable
    rate: Callable
    frequency: float | None = None
    amplitude: float | None = None


def sine(name: str, omega: float, draw: Draw) -> Excitation:
    """Whole periods of a sine about the bias."""
    period, size, bias = 2 * np.pi / omega, draw.amplitude, draw.bias
    time = np.arange(SINE_SAMPLES * SINE_PERIODS) * (period / SINE_SAMPLES)
    return Excitation(
        name,
        "sine",
        time,
        lambda t: bias + size * np.sin(omega * t),
        lambda t: size * omega * np.cos(omega * t),
        1 / period,
        size,
    )


def step(name: str, omega: float, draw: Draw) -> Excitation:
    """A step from the bias after a tenth of the record; it rises within one sample."""
    size, bias, end = draw.amplitude, draw.bias, 50 / omega
    time = np.arange(OTHER_SAMPLES) * (end / OTHER_SAMPLES)
    interval, begins = time[1], time[OTHER_SAMPLES // 10]
    return Excitation(
        name,
        "step",
        time,
        lambda t: bias + size * np.interp(t, (begins, begins + interval), (0.0, 1.0)),
        lambda t: size / interval * ((t >= begins) & (t < begins + interval)),
    )


def chirp(name: str, omega: float, draw: Draw) -> Excitation:
    """A sine whose frequency rises linearly from a fifth to three times the characteristic one."""
    size, bias, end = draw.amplitude, draw.bias, 80 / omega
    low, slope = 0.2 * omega, 2.8 * omega / end
    time = np.arange(2 * OTHER_SAMPLES) * (end / (2 * OTHER_SAMPLES))
    return Excitation(
        name,
        "chirp",
        time,
        lambda t: bias + size * np.sin(low * t + 0.5 * slope * t**2),
        lambda t: size * (low + slope * t) * np.cos(low * t + 0.5 * slope * t**2),
    )


def excitations(rng: np.random.Generator, family: Family, draw: Draw) -> list[Excitation]:
    """Three to six sines about the characteristic frequency, and often a step or a chirp."""
    factors = np.geomspace(0.3, 2.5, int(rng.integers(3, 7)))
    tests = [sine(f"sine_{k + 1}", draw.rate * factor, draw) for k, factor in enumerate(factors)]
    also = rng.choice(["", "step", "chirp"])
    if also == "step" and family.stepped:
        tests = [*tests[:3], step("step", draw.rate, draw)]
    if also == "chirp":
        tests = [*tests[:2], chirp("chirp", draw.rate, draw)]
    return tests


def respond(family: Family, draw: Draw, values: Values, test: Excitation, tolerance: float = TOLERANCE) -> np.ndarray:
    """Outputs (output, time) of the truth without noise.

    Parameters
    ----------
    family, draw
        The system.
    values
        Parameters, constants and extras of the truth.
    test
        The excitation. Its input comes late where the truth has a ``delay``; it runs on before the record.
    tolerance
        Relative tolerance of the integrator.
    """
    late = values.get("delay", 0.0)

    def drive(t):
        before = t - late if late else t
        return test.value(before), test.rate(before)

    states = None
    if family.rates is not None:
        rates, interval = family.rates, test.time[1]
        begin = np.zeros(len(draw.scales))
        first = family.begin(values) if family.begin else []
        begin[: len(first)] = first
        found = solve_ivp(
            lambda t, x: rates(values, x, drive(t)),
            (0, test.time[-1]),
            begin,
            "LSODA",
            test.time,
            rtol=tolerance,
            atol=1e-3 * tolerance * np.array(draw.scales),
            max_step=10 * interval,
            first_step=1e-3 * interval,
        )
        states = found.y
        if not found.success:
            raise RuntimeError(f"{family.name}: {found.message}")
    outputs = family.response(values, states, drive(test.time))
    return np.array([np.broadcast_to(output, test.time.shape) for output in outputs], dtype=float)
