"""What a rig can do at most, in SI units, and which tests ask for more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mofit.campaign import Procedure
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.identifiability.space import Limits
from mofit.model import Model
from mofit.readers.map_file import Quantity, quantity
from mofit.signals import smooth_derivative

Array = NDArray[np.float64]

#: Rounding of a grid's values must not push a test over a limit that it is meant to reach.
_SLACK = 1e-3


@dataclass(frozen=True)
class Reach:
    """Largest magnitudes that a test asks of the rig, or that the rig can give; infinite where not limited.

    ``channel`` is the driven input, ``amplitude`` in its unit, ``rate`` and ``acceleration`` per s and s²,
    ``sample_rate`` in Hz, ``duration`` in s, ``outputs`` by name.
    """

    channel: str = ""
    amplitude: float = np.inf
    rate: float = np.inf
    acceleration: float = np.inf
    sample_rate: float = np.inf
    duration: float = np.inf
    outputs: Mapping[str, float] = field(default_factory=dict)


def driven_input(model: Model) -> tuple[str, str]:
    """Name and unit of the channel that a rig drives."""
    channel = next(channel for channel in model.inputs if channel.derivative_of is None)
    return channel.name, channel.unit


def reach_of(limits: Limits, model: Model) -> Reach:
    """A space's limits in SI units.

    Raises
    ------
    InputError
        With every quantity of the wrong unit, every unknown output and every limit that is not above 0.
    """
    driven, unit = driven_input(model)
    outputs = {channel.name: channel.unit for channel in model.outputs}
    faults = [
        Fault("space, limits.outputs", f"model '{model.name}' has no output '{name}'", did_you_mean(name, outputs))
        for name in limits.outputs
        if name not in outputs
    ]
    units = _units(unit)
    own = {key: _positive(f"space, limits.{key}", getattr(limits, key), units[key], faults) for key in units}
    largest = {
        name: _positive(f"space, limits.outputs.{name}", value, outputs[name], faults)
        for name, value in limits.outputs.items()
        if name in outputs
    }
    raise_errors(faults)
    return Reach(driven, **own, outputs=largest)


def _units(unit: str) -> dict[str, str]:
    return {
        "amplitude": unit,
        "rate": f"{unit}/s",
        "acceleration": f"{unit}/s^2",
        "sample_rate": "Hz",
        "duration": "s",
    }


def _positive(where: str, value: Quantity | None, unit: str, faults: list[Fault]) -> float:
    if value is None:
        return np.inf
    try:
        number, _ = quantity(where, value, unit)
    except InputError as error:
        faults += error.faults
        return np.inf
    if not number > 0:
        faults.append(Fault(where, f"{value} is not above 0", "Give a positive limit, or leave it out"))
    return number


def asked(procedure: Procedure, driven: str, measured: bool = False) -> Reach:
    """What a test asks of the rig, its outputs aside.

    Accelerations of ramps, which are corners, count as none. ``measured`` inputs are noisy: their derivatives are
    those of a smoothing spline.
    """
    time, values = procedure.time, np.asarray(procedure.inputs[driven], dtype=float)
    if procedure.hold == "linear":
        rate, acceleration = np.diff(values) / np.diff(time), np.zeros(1)
    elif measured:
        _, rate = smooth_derivative(time, values)
        acceleration = np.gradient(rate, time)
    else:
        curve = CubicSpline(time, values)
        rate, acceleration = curve(time, 1), curve(time, 2)
    return Reach(
        channel=driven,
        amplitude=float(np.max(np.abs(values))),
        rate=float(np.max(np.abs(rate))),
        acceleration=float(np.max(np.abs(acceleration))),
        sample_rate=1 / procedure.step,
        duration=float(time[-1] - time[0]) + procedure.step,
    )


def refusal(wanted: Reach, limit: Reach, unit: str) -> str:
    """Which limit a test breaks, in words with numbers; empty if none."""
    units = _units(unit)
    if wanted.channel != limit.channel:  # a calibration stage's own input
        units = {key: own for key, own in units.items() if key in ("sample_rate", "duration")}
    for key, own in units.items():
        need, can = getattr(wanted, key), getattr(limit, key)
        if need > can * (1 + _SLACK):
            return f"{key.replace('_', ' ')}: {need:.3g} {own}, limit {can:.3g}"
    for name, need in wanted.outputs.items():
        if need > limit.outputs.get(name, np.inf) * (1 + _SLACK):
            return f"{name.replace('_', ' ')}: {need:.3g}, limit {limit.outputs[name]:.3g} (SI)"
    return ""


def reach_shown(tests: Sequence[Reach]) -> Reach:
    """What a rig has shown that it can do: the largest of every kind. Durations and outputs stay open."""
    return Reach(
        channel=tests[0].channel,
        amplitude=max(test.amplitude for test in tests),
        rate=max(test.rate for test in tests),
        acceleration=max((test.acceleration for test in tests if test.acceleration > 0), default=np.inf),
        sample_rate=max(test.sample_rate for test in tests),
    )
