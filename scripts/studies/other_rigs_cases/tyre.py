"""A tyre on a drum, lateral: Rill's curve, carcass with a Maxwell branch; SI units but for time and steer.

The equations are those of Hackl et al. 2016, written anew. The branch is a force that relaxes. A force of the rate
beside the damper is found by Newton's method.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mofit._typing import FloatArray
from other_rigs_cases.element import Element
from other_rigs_cases.rig import Drive, Motion, Rig, Units, Values, integrate

FREQUENCY, SPEED, RADIUS, DRUM, LOAD, STEER = 2.0, 60 / 3.6, 0.305, 0.61, 3600.0, np.deg2rad(7.0)
TIME = 1 / (2 * np.pi * FREQUENCY)
#: keeps the slip finite at standstill: part of its definition
STANDSTILL = 0.01
#: of a standing tyre: stroke [m], samples, sampling interval [s]
STROKE, SLOW_COUNT, SLOW_STEP = 0.02, 400, 0.1
NEWTON = 4
CENTRE = {
    "dF0": 62e3,
    "s_M": 0.13,
    "F_M": 3100.0,
    "c_y": 121819.0,
    "p_y": -7.5,
    "d_y": 281.0,
    "c_M": 19910.0,
    "d_M": 7535.0,
}
SPREAD = {"dF0": 0.08, "s_M": 0.06, "F_M": 0.05, "c_y": 0.08, "p_y": 0.1, "d_y": 0.15, "c_M": 0.15, "d_M": 0.15}


def _draw(rng: np.random.Generator) -> dict[str, float]:
    return {name: value * (1 + SPREAD[name] * float(np.clip(rng.normal(), -2, 2))) for name, value in CENTRE.items()}


def _secant(p: Values, slip: FloatArray) -> FloatArray:
    """Force over slip [N] of Rill's curve."""
    a = np.abs(slip) / p["s_M"]
    rising = p["dF0"] / (1 + a * (a + p["dF0"] * p["s_M"] / p["F_M"] - 2))
    along = np.clip((a - 1) / 2, 0, 1)
    beyond = p["F_M"] * (1 - 0.05 * along**2 * (3 - 2 * along)) / np.maximum(a, 1) / p["s_M"]
    return np.asarray(np.where(a <= 1, rising, beyond))


def carcass(p: Values, y: FloatArray) -> FloatArray:
    """Force of the spring [N]."""
    held = np.clip(y, 0.5 / p["p_y"], -0.5 / p["p_y"])
    return np.asarray(p["c_y"] * (1 + p["p_y"] * np.abs(held)) * held)


def _respond(p: Values, hidden: Element, drive: Drive, knobs: Mapping[str, float]) -> Motion:
    speed, angle = SPEED * drive.speed, STEER * drive.u
    transport = np.abs(speed * np.cos(angle)) + STANDSTILL
    slip = speed * np.sin(angle) / transport
    slope = _secant(p, slip) * hidden.spring_factor(drive.clock)
    if size := knobs.get("drum"):
        slope = slope * (1 + size * np.cos(speed * TIME * drive.time / DRUM + drive.angle))
    steady, give = slope * slip, slope / transport

    def rate(k: int, z: FloatArray) -> FloatArray:
        """Of the deflection, m/s."""
        factor = hidden.spring_factor(drive.clock[k])
        held = factor * carcass(p, z[0]) + hidden.spring(z[0]) + z[1] + hidden.branches(z[2:]) + hidden.rubbing(z[2:])
        damper = hidden.damper_factor(drive.clock[k]) * p["d_y"] + hidden.film(z[0], TIME) + give[k]
        load = steady[k] - held
        v = load / damper
        for _ in range(NEWTON if knobs.keys() & {"quadratic", "power"} else 0):
            over = damper * v + hidden.damper(v * TIME) - load
            v = v - over / (damper + hidden.damper_slope(v * TIME) * TIME)
        return np.asarray(v)

    def rates(k: int, z: FloatArray) -> FloatArray:
        v = rate(k, z)
        branch = p["c_M"] * v - p["c_M"] / p["d_M"] * z[1]
        return np.concatenate([[TIME * v, TIME * branch], hidden.rates(TIME * v, TIME * v, z[2:])])

    z = integrate(rates, np.zeros((2 + hidden.states, slip.shape[1])), len(slip))
    v = np.array([rate(2 * n, z[n]) for n in range(len(z))])
    return Motion(steady[::2] - give[::2] * v, z[:, 0], TIME * v)


TYRE = Rig(
    "tyre",
    "tyre on a drum",
    ("slip_angle", "rad"),
    ("lateral_force", "N"),
    _draw,
    lambda rng: Units(STEER, 1.0, TIME),
    _respond,
    "c_y",
    model="maxwell_tyre",
    rolling=True,
    conditions={
        "vertical_force": (LOAD, "N"),
        "dynamic_rolling_radius": (RADIUS, "m"),
        "drum_radius": (DRUM, "m"),
    },
)


def stroke() -> FloatArray:
    """Displacement of the standing tyre [m]."""
    corners = SLOW_COUNT * np.array([0, 0.25, 0.75, 1.0])
    return np.interp(np.arange(SLOW_COUNT), corners, STROKE * np.array([0.0, 1.0, -1.0, 0.0]))


def standing(p: Values, hidden: Element) -> FloatArray:
    """Force of the standing tyre [N]: its springs."""
    return np.asarray(carcass(p, stroke()) + hidden.spring(stroke()))
