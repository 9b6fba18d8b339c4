"""Damper, oscillator, robot joint and structure: an angular frequency of 1 is about that of the rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mofit._typing import FloatArray
from other_rigs_cases.element import Element
from other_rigs_cases.models import joint_source, structure_source
from other_rigs_cases.rig import Drive, Motion, Rig, Units, Values, integrate, log_uniform


def _damper_draw(rng: np.random.Generator) -> dict[str, float]:
    return {"c": 1.0, "p": rng.uniform(-0.1, 0.2), "d": rng.uniform(0.3, 1.0), "offset": rng.uniform(-0.1, 0.1)}


def _damper(p: Values, hidden: Element, drive: Drive, knobs: Mapping[str, float]) -> Motion:
    u, v, clock = drive.u, drive.v, drive.clock
    z = np.zeros((u.shape[0] // 2 + 1, hidden.states, u.shape[1]))
    if hidden.states:
        z = integrate(lambda k, z: hidden.rates(v[k], v[k], z), z[0], len(u))
    x, v, clock, states = u[::2], v[::2], clock[::2], np.moveaxis(z, 1, 0)
    spring = hidden.spring_factor(clock) * p["c"] * (1 + p["p"] * np.abs(x)) * x + hidden.spring(x)
    damper = hidden.damper_factor(clock) * p["d"] * v + hidden.damper(v) + hidden.film(x, v)
    return Motion(spring + damper + hidden.branches(states) + hidden.rubbing(states) + p["offset"], x, v)


DAMPER = Rig(
    "damper",
    "stroked damper",
    ("displacement", "m"),
    ("force", "N"),
    _damper_draw,
    lambda rng: Units(
        log_uniform(rng, 1e-3, 0.1), log_uniform(rng, 10, 1e5), 1 / (2 * np.pi * log_uniform(rng, 0.3, 10))
    ),
    _damper,
    "c",
    model="kelvin_voigt_damper",
)


def _oscillator_draw(rng: np.random.Generator) -> dict[str, float]:
    return {"m": 1.0, "k": 1.0, "d": 2 * log_uniform(rng, 0.05, 0.2), "offset": rng.uniform(-0.05, 0.05)}


def _oscillator(p: Values, hidden: Element, drive: Drive, knobs: Mapping[str, float]) -> Motion:
    def rates(k: int, z: FloatArray) -> FloatArray:
        x, v, inner = z[0], z[1], z[2:]
        return np.concatenate(
            [[v, (drive.u[k] - forces(x, v, inner, drive.clock[k])) / p["m"]], hidden.rates(v, v, inner)]
        )

    def forces(x: FloatArray, v: FloatArray, inner: FloatArray, clock: FloatArray) -> FloatArray:
        spring = hidden.spring_factor(clock) * p["k"] * x + hidden.spring(x) + hidden.branches(inner)
        damper = hidden.damper_factor(clock) * p["d"] * v + hidden.damper(v) + hidden.film(x, v)
        return np.asarray(spring + damper + hidden.rubbing(inner))

    z = integrate(rates, np.zeros((2 + hidden.states, drive.u.shape[1])), len(drive.u))
    return Motion(z[:, 0] + p["offset"], z[:, 0], z[:, 1])


OSCILLATOR = Rig(
    "oscillator",
    "single-mode oscillator",
    ("force", "N"),
    ("displacement", "m"),
    _oscillator_draw,
    lambda rng: Units(
        log_uniform(rng, 0.1, 1e4), log_uniform(rng, 1e-5, 0.1), 1 / (2 * np.pi * log_uniform(rng, 1, 100))
    ),
    _oscillator,
    "k",
    model="oscillator",
)


def _joint_draw(rng: np.random.Generator) -> dict[str, float]:
    link = rng.uniform(0.7, 2.0)
    return {"J": 1.0, "J_l": link, "k": link / (1 + link), "b": rng.uniform(0.1, 0.3), "d": rng.uniform(0.05, 0.15)}


def _joint(p: Values, hidden: Element, drive: Drive, knobs: Mapping[str, float]) -> Motion:
    def rates(k: int, z: FloatArray) -> FloatArray:
        x, motor, link, inner, clock = z[0], z[1], z[2], z[3:], drive.clock[k]
        gear = (
            hidden.spring_factor(clock) * p["k"] * x
            + hidden.spring(x)
            + hidden.branches(inner)
            + p["d"] * (motor - link)
            + hidden.film(x, motor - link)
        )
        bearing = hidden.damper_factor(clock) * p["b"] * motor + hidden.damper(motor) + hidden.rubbing(inner)
        moved = [motor - link, (drive.u[k] - bearing - gear) / p["J"], gear / p["J_l"]]
        return np.concatenate([moved, hidden.rates(motor - link, motor, inner)])

    z = integrate(rates, np.zeros((3 + hidden.states, drive.u.shape[1])), len(drive.u))
    return Motion(z[:, 1], z[:, 0], z[:, 1])


JOINT = Rig(
    "joint",
    "robot joint",
    ("motor_torque", "N m"),
    ("motor_speed", "rad/s"),
    _joint_draw,
    lambda rng: Units(log_uniform(rng, 0.1, 1e3), log_uniform(rng, 0.3, 30), 1 / (2 * np.pi * log_uniform(rng, 1, 30))),
    _joint,
    "k",
    source=joint_source,
)


def _structure_draw(rng: np.random.Generator) -> dict[str, float]:
    second = {"m_2": rng.uniform(0.4, 1.0), "k_2": rng.uniform(0.6, 1.2), "d_2": rng.uniform(0.03, 0.1)}
    return {"m_1": 1.0, "k_1": 1.0, "d_1": rng.uniform(0.08, 0.2), **second}


def _structure(p: Values, hidden: Element, drive: Drive, knobs: Mapping[str, float]) -> Motion:
    def first(z: FloatArray, u: FloatArray, clock: FloatArray) -> FloatArray:
        """Acceleration of the first mass; states come first in z."""
        x, v, y, w, inner = z[0], z[1], z[2], z[3], z[4:]
        ground = hidden.spring_factor(clock) * p["k_1"] * x + hidden.spring(x) + hidden.branches(inner)
        ground = ground + hidden.damper_factor(clock) * p["d_1"] * v + hidden.damper(v) + hidden.film(x, v)
        ground = ground + hidden.rubbing(inner)
        return np.asarray((u - ground - p["k_2"] * (x - y) - p["d_2"] * (v - w)) / p["m_1"])

    def rates(k: int, z: FloatArray) -> FloatArray:
        x, v, y, w = z[:4]
        second = (p["k_2"] * (x - y) + p["d_2"] * (v - w)) / p["m_2"]
        return np.concatenate([[v, first(z, drive.u[k], drive.clock[k]), w, second], hidden.rates(v, v, z[4:])])

    z = integrate(rates, np.zeros((4 + hidden.states, drive.u.shape[1])), len(drive.u))
    return Motion(first(np.moveaxis(z, 1, 0), drive.u[::2], drive.clock[::2]), z[:, 0], z[:, 1])


STRUCTURE = Rig(
    "structure",
    "structure of two modes",
    ("force", "N"),
    ("acceleration", "m/s^2"),
    _structure_draw,
    lambda rng: Units(log_uniform(rng, 1, 1e4), log_uniform(rng, 0.1, 30), 1 / (2 * np.pi * log_uniform(rng, 1, 60))),
    _structure,
    "k_1",
    source=structure_source,
    periods=2,
)
