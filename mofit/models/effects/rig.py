"""The test rig: force variation per turn of wheel and drum, and errors of its sensors."""

from __future__ import annotations

import math
from collections.abc import Collection

import casadi as ca

from mofit.models.effect import Addition, Effect, Scaling
from mofit.models.library.steady_state import LOAD
from mofit.models.model import TARGET_UNIT, TIME, Condition, Symbols
from mofit.parameters import PER_TEST, Parameter, powers

#: how forces grow with the data: on a tyre with its load
FORCE = (("force or vertical_force", 1.0),)


def unknown_turn(suffix: str, of: str) -> tuple[Parameter, Parameter]:
    """Angle of what turns at the first sample of every test, and its rate relative to that of speed and radius.

    Cosine and sine span what an angle does. Its range holds every angle three times, so that none is at an end of it.
    A rolling radius is known to some tenths of a percent: in 20 s at 10 Hz half a percent is a whole turn.
    """
    end = 3 * math.pi
    return (
        Parameter(
            f"theta_{suffix}", "rad", -end, end, 0.0, description=f"angle of the {of} at the first sample",
            grid=(0.0, math.pi / 2), per=PER_TEST,
        ),
        Parameter(
            f"e_{suffix}", "1", -6e-3, 6e-3, 0.0, description=f"relative error of the {of}'s rate",
            grid=(-4e-3, -2e-3, 0.0, 2e-3, 4e-3),
        ),
    )  # fmt: skip


class WheelOrder(Addition):
    r"""Force plus :math:`A_c \cos\theta + A_s \sin\theta` [N], :math:`\theta = v t / r + \theta_0`: non-uniformity.

    Fingerprint: one line at :math:`v / (2 \pi r)`, 8.7 Hz at 60 km/h, whatever the steer does. Each test's wheel
    angle at its first sample is the condition ``wheel_phase``. Where a test does not state it, there was no encoder:
    the term is :math:`A_w \cos((1 + e_w) v t / r + \theta_w)` then, with an angle :math:`\theta_w` per test and an
    error :math:`e_w` of the rate, both estimated.
    """

    name = "wheel_order"
    title = "force variation of the wheel"
    family = "non-uniformity of rotating parts"
    on = ("lateral_force", "longitudinal_force")
    needs = ("longitudinal_velocity",)
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "A_wc", "N", -500.0, 500.0, 14.0, description="cosine of the force variation", neutral=0.0, scales=LOAD
        ),
        Parameter(
            "A_ws", "N", -500.0, 500.0, 14.0, description="sine of the force variation", neutral=0.0, scales=LOAD
        ),
    )
    inputs = (TIME,)
    conditions: tuple[Condition, ...] = (
        Condition("dynamic_rolling_radius", "m", 0.305, "radius that the wheel turns with"),
        Condition("wheel_phase", "rad", 0.0, "angle of the wheel at the first sample"),
    )
    of_rig = True

    def __init__(self, angle_known: bool = True) -> None:
        self.angle_known = angle_known
        if not angle_known:
            amplitude = Parameter(
                "A_w", "N", 0.0, 500.0, 20.0, description="amplitude of the force variation", neutral=0.0, scales=LOAD
            )
            self.parameters = (amplitude, *unknown_turn("w", "wheel"))
            self.conditions = tuple(one for one in self.conditions if one.name != "wheel_phase")

    def for_tests(self, stated: Collection[str]) -> Effect:
        """With an angle per test where some test does not state it."""
        return WheelOrder("wheel_phase" in stated)

    def term(self, s: Symbols) -> ca.SX:
        """Variation of the force."""
        turned = s.longitudinal_velocity * s.time / s.dynamic_rolling_radius
        if not self.angle_known:
            return s.A_w * ca.cos((1 + s.e_w) * turned + s.theta_w)
        angle = turned + s.wheel_phase
        return s.A_wc * ca.cos(angle) + s.A_ws * ca.sin(angle)


class ShaftOrder(Addition):
    r"""Output plus :math:`A_c \cos\theta + A_s \sin\theta`, :math:`\theta = \Omega t + \theta_0`: a part that rotates.

    Unbalance of a shaft, ripple of a motor's torque, pulsation of a pump. Every test states the part's speed
    :math:`\Omega` as ``rotational_speed`` [rad/s], and its angle at the first sample as ``shaft_angle`` [rad]. Where a
    test does not state the angle, there was no encoder: the term is :math:`A_o \cos((1 + e_o) \Omega t + \theta_o)`
    then, with an angle :math:`\theta_o` per test and an error :math:`e_o` of the speed, both estimated. Fingerprint:
    one line at :math:`\Omega / (2 \pi)`, whatever the input does.
    """

    name = "shaft_order"
    title = "once-per-turn variation of a rotating part"
    family = "non-uniformity of rotating parts"
    on = ("output",)
    parameters: tuple[Parameter, ...] = tuple(
        Parameter(
            f"A_o{suffix}", TARGET_UNIT, -500.0, 500.0, 14.0, description=f"{part} of the variation", neutral=0.0,
            scales=powers(output=1),
        )
        for suffix, part in (("c", "cosine"), ("s", "sine"))
    )  # fmt: skip
    inputs = (TIME,)
    conditions: tuple[Condition, ...] = (
        Condition("rotational_speed", "rad/s", None, "speed of what rotates"),
        Condition("shaft_angle", "rad", 0.0, "angle of what rotates at the first sample"),
    )
    of_rig = True

    def __init__(self, angle_known: bool = True) -> None:
        self.angle_known = angle_known
        if not angle_known:
            amplitude = Parameter(
                "A_o", TARGET_UNIT, 0.0, 500.0, 20.0, description="amplitude of the variation", neutral=0.0,
                scales=powers(output=1),
            )  # fmt: skip
            self.parameters = (amplitude, *unknown_turn("o", "shaft"))
            self.conditions = tuple(one for one in self.conditions if one.name != "shaft_angle")

    def for_tests(self, stated: Collection[str]) -> Effect:
        """With an angle per test where some test does not state it."""
        return ShaftOrder("shaft_angle" in stated)

    def term(self, s: Symbols) -> ca.SX:
        """Variation of the output."""
        turned = s.rotational_speed * s.time
        if not self.angle_known:
            return s.A_o * ca.cos((1 + s.e_o) * turned + s.theta_o)
        angle = turned + s.shaft_angle
        return s.A_oc * ca.cos(angle) + s.A_os * ca.sin(angle)


class DrumRunout(Scaling):
    r"""Load, and the contact patch's force with it, times :math:`1 + m_c \cos\theta + m_s \sin\theta`.

    :math:`\theta = v t / R + \theta_0` with the drum's radius :math:`R`, 0.61 m where the file does not state it
    (4.35 Hz at 60 km/h), and its angle at the first sample, ``drum_phase``. Where a test does not state it the change
    is :math:`m_d \cos((1 + e_d) v t / R + \theta_d)`, with an angle :math:`\theta_d` per test and an error :math:`e_d`
    of the rate, both estimated. Fingerprint: sidebands of the drum order, ± f.
    """

    name = "drum_runout"
    title = "run-out of the drum"
    family = "non-uniformity of rotating parts"
    on = ("slip_stiffness",)
    needs = ("longitudinal_velocity",)
    parameters: tuple[Parameter, ...] = (
        Parameter("m_dc", "1", -0.3, 0.3, 0.0057, description="cosine of the load's modulation", neutral=0.0),
        Parameter("m_ds", "1", -0.3, 0.3, 0.0057, description="sine of the load's modulation", neutral=0.0),
    )
    inputs = (TIME,)
    conditions: tuple[Condition, ...] = (
        Condition("drum_radius", "m", 0.61, "radius of the drum"),
        Condition("drum_phase", "rad", 0.0, "angle of the drum at the first sample"),
    )
    of_rig = True

    def __init__(self, angle_known: bool = True) -> None:
        self.angle_known = angle_known
        if not angle_known:
            amplitude = Parameter(
                "m_d", "1", 0.0, 0.3, 0.008, description="amplitude of the load's modulation", neutral=0.0
            )
            self.parameters = (amplitude, *unknown_turn("d", "drum"))
            self.conditions = tuple(one for one in self.conditions if one.name != "drum_phase")

    def for_tests(self, stated: Collection[str]) -> Effect:
        """With an angle per test where some test does not state it."""
        return DrumRunout("drum_phase" in stated)

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Modulation of the load."""
        turned = s.longitudinal_velocity * s.time / s.drum_radius
        if not self.angle_known:
            return s.m_d * ca.cos((1 + s.e_d) * turned + s.theta_d)
        angle = turned + s.drum_phase
        return s.m_dc * ca.cos(angle) + s.m_ds * ca.sin(angle)


class ForceGain(Scaling):
    r"""Force :math:`(1 + g) F`: gain error of the transducer. Fingerprint: all harmonics alike."""

    name = "force_gain"
    title = "force gain"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    of_rig = True
    parameters = (Parameter("g_F", "1", -0.2, 0.2, 0.02, description="gain error of the force", neutral=0.0),)


class ForceOffset(Addition):
    r"""Force :math:`F + F_{off}`: conicity of a tyre, zero drift of a transducer. Fingerprint: mean value only."""

    name = "force_offset"
    title = "force offset"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    of_rig = True
    parameters = (
        Parameter("F_off", "N", -500.0, 500.0, 25.0, description="offset of the force", neutral=0.0, scales=FORCE),
    )


class TestOffset(Addition):
    r"""Force :math:`F + F_t`: zero drift of a transducer that is not set to zero before every test.

    Fingerprint: mean values that differ from test to test, whatever it is.
    """

    name = "test_offset"
    title = "force offset of each test"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    parameters = (
        Parameter(
            "F_t", "N", -500.0, 500.0, 25.0, description="offset of the force in a test", neutral=0.0, per=PER_TEST,
            scales=FORCE,
        ),
    )  # fmt: skip
    of_rig = True


class SlipOffset(Addition):
    r"""Slip angle :math:`\alpha + \alpha_0`: toe, ply steer, alignment. Fingerprint: mean value and second harmonic."""

    name = "slip_offset"
    title = "slip-angle offset"
    family = "sensor error"
    on = ("slip_angle",)
    of_rig = True
    # 0.08 degrees where the angle moves by two degrees to either side
    parameters = (
        Parameter(
            "alpha_0", "rad", -0.03, 0.03, 0.002, description="slip-angle offset", neutral=0.0,
            scales=powers(slip_angle=1),
        ),
    )  # fmt: skip


class CrossTalk(Addition):
    r"""Force :math:`F + \chi F_z`: tilted or coupled force transducer.

    At one load it is a force offset, so a diagnosis tries it only when named. Fingerprint: mean value,
    proportional to the load.
    """

    name = "cross_talk"
    title = "cross-talk of the load"
    family = "sensor error"
    on = ("lateral_force",)
    of_rig = True
    parameters = (Parameter("chi_z", "1", -0.1, 0.1, 0.005, description="cross-talk of the load", neutral=0.0),)
    conditions = (Condition("vertical_force", "N", None, "vertical load"),)
    candidate = False

    def term(self, s: Symbols) -> ca.SX:
        """Share of the load that the lateral channel shows."""
        return s.chi_z * s.vertical_force
