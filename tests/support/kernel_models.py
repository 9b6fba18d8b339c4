"""Small models with known answers."""

from __future__ import annotations

import casadi as ca
import numpy as np

from mofit.models import Channel, Equations, Model, System, build_system
from mofit.models.library.tyres import MaxwellTyre
from mofit.parameters import Parameter
from mofit.simulation import ExperimentData


class Relaxation(Model):
    """x' = (u - x) / tau from x(0) = start; y = gain x."""

    name = "relaxation"
    states = (Channel("x", "m"),)
    inputs = (Channel("u", "m"),)
    outputs = (Channel("y", "N"),)
    parameters = (
        Parameter("tau", "s", 1e-6, 10.0, 0.3, "log"),
        Parameter("gain", "N/m", 0.1, 10.0, 2.0),
        Parameter("start", "m", -1.0, 1.0, 0.5),
    )

    def equations(self, s):
        return Equations({"y": s.gain * s.x}, {"x": (s.u - s.x) / s.tau}, {"x": s.start})


class Oscillator(Model):
    """m x'' + d x' + k x = u; y = x."""

    name = "mass_on_a_spring"
    states = (Channel("x", "m"), Channel("v", "m/s"))
    inputs = (Channel("u", "N"),)
    outputs = (Channel("y", "m"),)
    parameters = (
        Parameter("m", "kg", 1e-6, 10.0, 1.0, "log"),
        Parameter("d", "N s/m", 1e-6, 1e6, 1.0, "log"),
        Parameter("k", "N/m", 1.0, 1e8, 100.0, "log"),
    )

    def equations(self, s):
        return Equations({"y": s.x}, {"x": s.v, "v": (s.u - s.d * s.v - s.k * s.x) / s.m})


class Static(Model):
    """y = k |u|^1.5 sign(u) + b; no states."""

    name = "static"
    inputs = (Channel("u", "m"),)
    outputs = (Channel("y", "N"),)
    parameters = (Parameter("k", "N", 0.1, 10.0, 2.0), Parameter("b", "N", -1.0, 1.0, 0.5))

    def equations(self, s):
        return Equations({"y": s.k * ca.fabs(s.u) ** 1.5 * ca.sign(s.u) + s.b})


def sine_experiment(
    system: System, frequency: float = 1.0, samples: int = 200, step: float = 0.01, **other
) -> ExperimentData:
    """A sine on every input; measured outputs are noise; the first tenth has no weight."""
    rng = np.random.default_rng(7)
    time = np.arange(samples) * step
    amplitude = other.pop("amplitude", 1.0)
    inputs = np.tile(amplitude * np.sin(2 * np.pi * frequency * time)[:, None], (1, len(system.inputs)))
    weights = rng.uniform(0.5, 2.0, (samples, len(system.outputs)))
    weights[: samples // 10] = 0
    measured = rng.normal(size=weights.shape) * (weights != 0) * other.pop("scale", 1.0)
    conditions = np.asarray(other.pop("conditions", np.zeros(len(system.conditions))), dtype=float)
    return ExperimentData(
        f"{frequency:g} Hz", step, inputs, other.pop("interpolation", "cubic"), conditions, measured, weights
    )


RELAXATION, OSCILLATOR, STATIC = (build_system(model()) for model in (Relaxation, Oscillator, Static))

TYRE = build_system(MaxwellTyre())
LOWER, UPPER, NOMINAL = (
    np.array([getattr(parameter, name) for parameter in MaxwellTyre.parameters])
    for name in ("lower", "upper", "nominal")
)
DYNAMIC = ("d_y", "c_M", "d_M")
ROLLING = (40 / 3.6, 1.0, 0.01)


def tyre_experiment(frequency, samples=100, degrees=1.0, **other):
    return sine_experiment(
        TYRE, frequency, samples, amplitude=np.deg2rad(degrees), conditions=ROLLING, scale=100.0, **other
    )


def dynamic_box(**changes):
    lower, upper = NOMINAL.copy(), NOMINAL.copy()
    for name in DYNAMIC:
        at = TYRE.parameters.index(name)
        lower[at], upper[at] = changes.get(name, (LOWER[at], UPPER[at]))
    return lower, upper


def draws(lower, upper, unit):
    """Values from the unit cube, logarithmic where bounds are positive."""
    low, high = (np.where(lower > 0, np.log(np.where(lower > 0, bound, 1.0)), bound) for bound in (lower, upper))
    values = low + unit * (high - low)
    return np.where(lower > 0, np.exp(np.minimum(values, 50.0)), values)
