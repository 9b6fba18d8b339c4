"""From the force in the carcass to what the channel records: masses, rotation, transducer, filter, drift."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from filters import lag, later, rational, slope_before
from numpy.typing import NDArray
from rig_tests import WHEEL_RADIUS, RigTest

Array = NDArray[np.float64]

#: force from which on the amplifier's gain is another, N; time in which a ringing fades, s
KNEE, FADING = 1300.0, 0.08


def transduced(test: RigTest, v: Mapping[str, float], time: Array, force: Array, rate: Array) -> Array:
    """Recorded force [N] (n,) from force [N] and rate of the deflection [m/s] on a fine uniform grid."""
    step = time[1]
    since = (test.start_time or 0.0) + time
    if v["m_b"]:
        # the curve's kink at zero slip makes the acceleration jump, at times just when a sample is taken; that sample
        # cannot know yet
        force = force - v["m_b"] * slope_before(rate, step)
    if v["q_rig"]:
        w = 2 * np.pi * v["f_rig"]
        force = force + v["q_rig"] * rational(force, [1.0, 0.0, 0.0], [1.0, 2 * v["z_rig"] * w, w**2], step)
    if v["A_wc"] or v["A_ws"]:
        turn = test.speed * (1 + v["e_v"]) * time / WHEEL_RADIUS + test.wheel_phase
        force = force + v["A_wc"] * np.cos(turn) + v["A_ws"] * np.sin(turn)
    for size, frequency in (("A_gear", "f_gear"), ("A_hum", "f_hum")):
        if v[size]:
            force = force + v[size] * np.sin(2 * np.pi * v[frequency] * since + v["phase"])
    if v["A_half"] and test.frequency:
        force = force + v["A_half"] * np.cos(np.pi * test.frequency * time + v["phase"])
    if v["A_ring"]:
        force = force + v["A_ring"] * _ringing(test, v["f_ring"], time)
    if v["g_knee"]:
        force = force - v["g_knee"] * np.sign(force) * np.maximum(np.abs(force) - KNEE, 0)
    if v["b_dead"]:
        force = force - np.clip(force, -v["b_dead"], v["b_dead"])
    if v["g_rate"] and test.frequency:
        # the hysteresis of a worn bearing turns with the steer, within a hundredth of a period
        turning = np.tanh(np.cos(2 * np.pi * test.frequency * time) / 0.03)
        force = force * (1 + v["g_rate"] * turning)
    force = (1 + v["g_F"]) * force
    force = force * (1 + v["k_t"] * since) * (1 + v["w_t"] * np.exp(-time / v["tau_t"]))
    force = force + v["F_off"]
    if v["T_second"]:
        w = np.sqrt(2) / v["T_second"]
        force = rational(force, [w**2], [1.0, np.sqrt(2) * w, w**2], step)
    if v["T_f"]:
        force = lag(force, v["T_f"], step)
    return later(force, v["tau_d"], step) if v["tau_d"] else force


def _ringing(test: RigTest, frequency: float, time: Array) -> Array:
    """A decaying oscillation after every reversal of the steer, of either sign in turn."""
    if not test.frequency:
        return np.zeros_like(time)
    half = 0.5 / test.frequency
    number, since = np.divmod(time - 0.5 * half, half)
    own = np.where(number < 0, 0.0, (-1.0) ** number)
    return own * np.exp(-since / FADING) * np.sin(2 * np.pi * frequency * since)
