"""From the commanded steer to the slip angle that the contact patch sees: what lies between is not in the records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from filters import lag, play
from numpy.typing import NDArray
from rig_tests import RigTest

Array = NDArray[np.float64]

#: cycle of the angle encoder's error, rad
ENCODER_CYCLE = np.deg2rad(0.8)
#: times between two of integration at which play is followed
BETWEEN = 8
#: half widths of the plays of a distributed play, over their mean
WIDTHS = (1 / 3, 1.0, 5 / 3)


def patch_angle(test: RigTest, v: Mapping[str, float], time: Array) -> Array:
    """Slip angle of the patch [rad] at uniform times (n,), but for what the force does to it."""
    step = time[1]
    plays = [v["b_0"]] if v["b_0"] else [width * v["b_g"] for width in WIDTHS if v["b_g"]]
    if plays:
        # it rests where the drive turns, which is between two times
        between = step / BETWEEN * np.arange(BETWEEN * (len(time) - 1) + 1)
        driven = _driven(test, v, between)
        angle = np.mean([play(driven, half_width)[::BETWEEN] for half_width in plays], axis=0)
    else:
        angle = _driven(test, v, time)
    angle = angle + v["alpha_0"]
    if v["sigma_c"]:
        angle = lag(angle, v["sigma_c"] / (test.speed * (1 + v["e_v"])), step)
    if v["L_patch"]:
        angle = _filled(angle, v["L_patch"] / (test.speed * (1 + v["e_v"])), step)
    return angle


def _driven(test: RigTest, v: Mapping[str, float], time: Array) -> Array:
    """Angle of the steering drive [rad]."""
    angle = test.command(time)
    if v["a_second"] and test.frequency:
        angle = angle + v["a_second"] * np.sin(4 * np.pi * test.frequency * time + v["phase"])
    if v["e_cyclic"]:
        angle = angle + v["e_cyclic"] * np.sin(2 * np.pi * angle / ENCODER_CYCLE + v["phase"])
    return angle


def _filled(angle: Array, passage: float, step: float) -> Array:
    """Slip that the bristles of a patch have taken up on their way through it, which lasts ``passage`` s.

    The bristle at x holds the slip of the last x / v seconds: over all, a delay t counts with 2 (1 - t / T) / T.
    """
    fine = np.arange(int(np.ceil(passage / step)) + 2) * step
    # exact for an angle that is linear between its samples: the kernel's moments against hat functions
    dense = np.linspace(0, passage, 2001)
    middle = 0.5 * (dense[1:] + dense[:-1])
    share = 2 * (1 - middle / passage) / passage * np.diff(dense)
    hats = np.maximum(1 - np.abs(middle[None] - fine[:, None]) / step, 0)
    weights = hats @ share
    padded = np.concatenate([np.full(len(fine) - 1, angle[0]), angle])
    return np.convolve(padded, weights / weights.sum(), mode="valid")
