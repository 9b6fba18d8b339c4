"""Noise-free records of a tyre's tests: steer in, contact patch and carcass, transducer out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from angle_side import patch_angle
from brush import secant
from force_side import transduced
from integrate import integrate
from knobs import BEHIND, DEFAULT
from numpy.typing import NDArray
from rig_tests import DRUM_RADIUS, RATE, RigTest

Array = NDArray[np.float64]

#: keeps the slip finite at standstill, m/s: part of the slip's definition (eq. 3 of the paper)
FICTITIOUS = 0.01
LANES = 1600
#: integration step of step tests, s
COARSE = 1e-2
#: forces that act back on angle or load are iterated over the whole record until they stand, N
STANDING, ROUNDS = 2e-3, 15


@dataclass(frozen=True)
class Case:
    """A specimen with knobs turned, of which some act in some kinds of tests only."""

    specimen: Mapping[str, float]
    knobs: Mapping[str, float] = field(default_factory=dict)
    #: kinds of tests in which a knob acts; all where a knob is not named
    kinds: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def values(self, kind: str) -> dict[str, float]:
        """All parameters and knobs as they are in a test of this kind."""
        acting = {name: v for name, v in self.knobs.items() if name not in self.kinds or kind in self.kinds[name]}
        return {**DEFAULT, **self.specimen, **acting}


def respond(jobs: Sequence[tuple[Case, RigTest]], step: float = 2.5e-3) -> list[Array]:
    """Force [N] of each test at its samples, without noise.

    ``step`` is that of the integration of sines in s; a sine that is sampled faster gets half of it, and half of that a
    fractional element, for its fastest relaxations; friction, which is stiff, and a mass, whose force is a derivative,
    get a quarter.
    """
    result: list[Array] = [np.empty(0)] * len(jobs)
    values = [case.values(test.kind) for case, test in jobs]
    sharing: dict[tuple[object, ...], list[int]] = {}
    for i, (_, test) in enumerate(jobs):
        if test.kind == "quasi_static":
            result[i] = _standing(test, values[i])
        else:
            inner = (v for name, v in values[i].items() if name not in BEHIND)
            # a mass acts behind the tyre, but asks for steps of its own
            sharing.setdefault((test, bool(values[i]["m_b"]), *inner), []).append(i)
    groups: dict[tuple[str, float, bool, tuple[bool, ...], bool, bool], list[list[int]]] = {}
    for members in sharing.values():
        test, v = jobs[members[0]][1], values[members[0]]
        states = tuple(bool(v[name]) for name in ("c_2", "c_f", "F_d"))
        finer = bool(v["F_d"] or v["m_b"])
        extra = any(v[name] for name in ("k_c", "k_a", "c_P", "k_bump", "d_2"))
        coupled = bool(v["kappa_s"] or v["kappa_z"])
        groups.setdefault((test.kind, test.rate, extra, states, coupled, finer), []).append(members)
    for (kind, sampling, _, (_, fractional, _), coupled, finer), lanes in groups.items():
        # tests of like length side by side; the shorter ones run on, unheeded
        lanes.sort(key=lambda members: -jobs[members[0]][1].duration)
        for start in range(0, len(lanes), LANES):
            part = lanes[start : start + LANES]
            first = [members[0] for members in part]
            # of a step test only the settled half counts
            usual = max(step, COARSE) if kind == "step" else step
            parts = (2 if sampling > RATE else 1) * (2 if fractional and usual < COARSE else 1) * (4 if finer else 1)
            force, rate, inner = _rolling(
                [jobs[i][1] for i in first], [values[i] for i in first], usual / parts, coupled
            )
            for lane, members in enumerate(part):
                for i in members:
                    test = jobs[i][1]
                    record = transduced(test, values[i], inner, force[:, lane], rate[:, lane])
                    result[i] = record[:: round(1 / test.rate / inner[1])][: len(test.time)]
    return result


def _standing(test: RigTest, v: Mapping[str, float]) -> Array:
    """The quasi-static test: the standing tyre, at each displacement until it has relaxed."""
    y = test.command(test.time)
    size = np.abs(y)
    force = v["c_y"] * (1 + v["p_y"] * size) * y
    force += v["k_c"] * y**3 + v["k_a"] * size + v["c_P"] * y / (1 + size / v["y_P"])
    return force + v["F_off"]


def _rolling(tests: list[RigTest], values: list[dict[str, float]], step: float, coupled: bool) -> tuple[Array, ...]:
    """Force, rate (n, lanes) and time (n,); tests of one kind and rate, the longest first, one lane each."""
    per_sample = max(round(1 / tests[0].rate / step), 1)
    step = 1 / tests[0].rate / per_sample
    count = len(tests[0].time) * per_sample
    time = step / 2 * np.arange(2 * count + 1)
    k = {name: np.array([v[name] for v in values]) for name in values[0]}
    speed = np.array([test.speed for test in tests]) * (1 + k["e_v"])
    angle = np.stack([patch_angle(test, v, time) for test, v in zip(tests, values, strict=True)], axis=1)
    load = 1.0
    if np.any(k["m_dc"]) or np.any(k["m_ds"]):
        turn = time[:, None] * speed / DRUM_RADIUS + [test.drum_phase for test in tests]
        load = 1 + k["m_dc"] * np.cos(turn) + k["m_ds"] * np.sin(turn)
    force, rate = _through_patch(angle, load, speed, step, k)
    for _ in range(ROUNDS if coupled else 0):
        before, back = force, _with_halves(force)
        force, rate = _through_patch(angle - k["kappa_s"] * back, load * (1 + k["kappa_z"] * back), speed, step, k)
        if np.max(np.abs(force - before)) < STANDING:
            break
    return force, rate, time[::2]


def _through_patch(
    angle: Array, load: Array | float, speed: Array, step: float, k: Mapping[str, Array]
) -> tuple[Array, Array]:
    """Force and rate at every step for the angle and relative load of the patch at steps and half-steps."""
    transport = np.abs(speed * np.cos(angle)) + FICTITIOUS
    slip = speed * np.sin(angle) / transport
    grip = load * secant(slip, k["dF0"] * (1 + k["e_alpha"]), k["s_M"], k["F_M"] * (1 + k["e_mu"]))
    if np.any(k["h_heat"]):
        grip *= 1 - k["h_heat"] * _heat(grip * slip**2 * speed, k["tau_heat"], step / 2)
    return integrate(step, grip * slip, grip / transport, {**k, "c_y": k["c_y"] * (1 + k["e_y"])})


def _heat(power: Array, tau: Array, step: float) -> Array:
    """Temperature of the tread over that of a steady kilowatt of sliding, (n, lanes)."""
    heat, keep = np.zeros_like(power), np.exp(-step / tau)
    for n in range(1, len(power)):
        heat[n] = keep * heat[n - 1] + (1 - keep) * 0.5e-3 * (power[n] + power[n - 1])
    return heat


def _with_halves(force: Array) -> Array:
    """Values at steps and half-steps from those at steps: cubic interpolation."""
    result = np.empty((2 * len(force) - 1, force.shape[1]))
    result[::2] = force
    padded = np.concatenate([2 * force[:1] - force[1:2], force, 2 * force[-1:] - force[-2:-1]])
    result[1::2] = (9 * (padded[1:-2] + padded[2:-1]) - padded[:-3] - padded[3:]) / 16
    return result
