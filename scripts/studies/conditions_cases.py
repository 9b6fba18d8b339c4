"""A Maxwell damper over load, pressure and speed, by an integrator that shares no code with mofit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeAlias

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Experiment, Measurement

#: load in N, pressure in Pa, speed in m/s
Combination: TypeAlias = tuple[float, float, float]

CONDITIONS = ("vertical_force", "inflation_pressure", "longitudinal_velocity")
LOADS, PRESSURES, SPEEDS = (2e3, 3e3, 4e3), (2e5, 2.5e5, 3e5), (10.0, 30.0)
LEFT_OUT: Combination = (3e3, 3e5, 30.0)
NOISE, RATE, SECONDS, STEPS = 20.0, 200.0, 2.0, 5
LINES = (1, 2, 4, 6, 10, 15)
PARAMETERS = ("c", "d", "c_M", "d_M", "F_0")
#: laws that are not constant
FORMS = {
    ("c", "vertical_force"): "linear", ("c", "inflation_pressure"): "linear", ("d", "longitudinal_velocity"): "linear",
    ("c_M", "vertical_force"): "linear", ("c_M", "longitudinal_velocity"): "linear",
    ("d_M", "vertical_force"): "quadratic", ("d_M", "longitudinal_velocity"): "linear",
}  # fmt: skip
LAWS = {(name, q): FORMS.get((name, q), "constant") for name in PARAMETERS for q in CONDITIONS}
TRUTH = {
    "c": 2e4, "d": 300.0, "c_M": 3e4, "d_M": 1500.0, "F_0": 5.0, "c_vertical_force": 0.25,
    "c_inflation_pressure": 0.10, "d_longitudinal_velocity": 0.15, "c_M_vertical_force": 0.20,
    "c_M_longitudinal_velocity": -0.10, "d_M_vertical_force": -0.15, "d_M_vertical_force_2": 0.10,
    "d_M_longitudinal_velocity": -0.20,
}  # fmt: skip


def combinations() -> list[Combination]:
    """All of them, with that left out."""
    return list(product(LOADS, PRESSURES, SPEEDS))


def name_of(at: Combination) -> str:
    """Name of the test under a combination."""
    return "F{:g} p{:g} v{:g}".format(*at)


def true_values(at: Combination) -> dict[str, float]:
    """Parameters under a combination."""
    x, y, s = (at[0] - 3e3) / 1e3, (at[1] - 2.5e5) / 0.5e5, (at[2] - 20.0) / 10.0
    return {
        "c": 2e4 * (1 + 0.25 * x) * (1 + 0.10 * y),
        "d": 300.0 * (1 + 0.15 * s),
        "c_M": 3e4 * (1 + 0.20 * x) * (1 - 0.10 * s),
        "d_M": 1500.0 * (1 - 0.15 * x + 0.10 * x**2) * (1 - 0.20 * s),
        "F_0": 5.0,
    }


def driven(
    known: Mapping[str, FloatArray], rng: np.random.Generator
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    """Time, strokes and forces without noise of dampers with these parameters, by four-stage Runge-Kutta steps.

    Each has a multisine with phases of its own.
    """
    phases = rng.uniform(0, 2 * np.pi, (len(known["c"]), len(LINES)))
    omega = 2 * np.pi * np.array(LINES) / SECONDS
    size = 0.01 / np.sqrt(np.arange(1, len(LINES) + 1))

    def stroke(t: float) -> FloatArray:
        return np.asarray(np.sin(omega * t + phases) @ size)

    def speed(t: float) -> FloatArray:
        return np.asarray(np.cos(omega * t + phases) @ (size * omega))

    def rate(t: float, inner: FloatArray) -> FloatArray:
        return np.asarray(known["c_M"] / known["d_M"] * (stroke(t) - inner))

    axis, step = np.arange(0, SECONDS, 1 / RATE), 1 / RATE / STEPS
    inner, strokes, forces = stroke(0.0), [], []
    for t in axis:
        x = stroke(t)
        strokes.append(x)
        forces.append(known["c"] * x + known["d"] * speed(t) + known["c_M"] * (x - inner) + known["F_0"])
        for k in range(STEPS):
            now = t + k * step
            k1 = rate(now, inner)
            k2 = rate(now + step / 2, inner + step / 2 * k1)
            k3 = rate(now + step / 2, inner + step / 2 * k2)
            k4 = rate(now + step, inner + step * k3)
            inner = inner + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return axis, list(np.array(strokes).T), list(np.array(forces).T)


def simulated(
    places: Sequence[Combination], rng: np.random.Generator
) -> tuple[tuple[Measurement, ...], list[FloatArray]]:
    """One noisy test under each combination, and their forces without noise."""
    axis, strokes, clean = driven({key: np.array([true_values(at)[key] for at in places]) for key in PARAMETERS}, rng)
    made = []
    for at, x, force in zip(places, strokes, clean, strict=True):
        conditions = dict(zip(CONDITIONS, at, strict=True))
        made.append(measured(Experiment(name_of(at), "free", axis, {"displacement": x}, conditions), force, rng))
    return tuple(made), clean


def measured(experiment: Experiment, force: FloatArray, rng: np.random.Generator) -> Measurement:
    """A test with a noisy force."""
    noisy = force + NOISE * rng.normal(size=len(force))
    return Measurement(experiment, {"force": noisy}, {"displacement": "m", "force": "N"})
