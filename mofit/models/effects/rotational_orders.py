"""Orders of what rotates: wheel, drum, a shaft; at angles that the tests state, or that are estimated."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Collection
from typing import Self

import casadi as ca

from mofit.models.effect import Addition, Effect, Scaling
from mofit.models.library.steady_state import LOAD
from mofit.models.model import TARGET_UNIT, TIME, Condition, Symbols
from mofit.parameters import PER_TEST, Parameter, powers


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


class RotationalOrder(Effect):
    r"""What varies once per turn: :math:`A_c \cos\theta + A_s \sin\theta` with the angle :math:`\theta` of a part.

    Where a test does not state the angle at its first sample, there was no encoder: it is
    :math:`A \cos((1 + e) \Omega t + \theta_0)` then, with an angle :math:`\theta_0` per test and an error :math:`e` of
    the speed :math:`\Omega`, both estimated.

    Attributes
    ----------
    part
        What rotates.
    suffix
        Of the names of angle and error of the speed.
    angle
        The condition that states the angle at the first sample, one of ``conditions``.
    amplitude
        The parameter A in place of cosine and sine.
    """

    family = "non-uniformity of rotating parts"
    inputs = (TIME,)
    of_rig = True
    part: str
    suffix: str
    angle: Condition
    amplitude: Parameter

    def __init__(self, angle_known: bool = True) -> None:
        self.angle_known = angle_known
        if not angle_known:
            self.parameters = (self.amplitude, *unknown_turn(self.suffix, self.part))
            self.conditions = tuple(one for one in self.conditions if one != self.angle)

    def for_tests(self, stated: Collection[str]) -> Self:
        """With an angle per test where some test does not state it."""
        return type(self)(self.angle.name in stated)

    @abstractmethod
    def turned(self, s: Symbols) -> ca.SX:
        """Angle since the first sample, by the speed that is stated [rad]."""

    def variation(self, s: Symbols) -> ca.SX:
        """The order, in the unit of its amplitude."""
        turned, known = self.turned(s), [getattr(s, parameter.name) for parameter in self.parameters]
        if not self.angle_known:
            amplitude, start, error = known
            return amplitude * ca.cos((1 + error) * turned + start)
        cosine, sine = known
        angle = turned + getattr(s, self.angle.name)
        return cosine * ca.cos(angle) + sine * ca.sin(angle)


class WheelOrder(RotationalOrder, Addition):
    r"""Force plus :math:`A_c \cos\theta + A_s \sin\theta` [N], :math:`\theta = v t / r + \theta_0`: non-uniformity.

    See `RotationalOrder`; the condition ``wheel_phase`` states the wheel's angle. Fingerprint: one line at
    :math:`v / (2 \pi r)`, 8.7 Hz at 60 km/h, whatever the steer does.
    """

    name = "wheel_order"
    title = "force variation of the wheel"
    on = ("lateral_force", "longitudinal_force")
    needs = ("longitudinal_velocity",)
    parameters = (
        Parameter(
            "A_wc", "N", -500.0, 500.0, 14.0, description="cosine of the force variation", neutral=0.0, scales=LOAD
        ),
        Parameter(
            "A_ws", "N", -500.0, 500.0, 14.0, description="sine of the force variation", neutral=0.0, scales=LOAD
        ),
    )
    part, suffix = "wheel", "w"
    angle = Condition("wheel_phase", "rad", 0.0, "angle of the wheel at the first sample")
    conditions = (Condition("dynamic_rolling_radius", "m", 0.305, "radius that the wheel turns with"), angle)
    amplitude = Parameter(
        "A_w", "N", 0.0, 500.0, 20.0, description="amplitude of the force variation", neutral=0.0, scales=LOAD
    )

    def turned(self, s: Symbols) -> ca.SX:
        """By speed and rolling radius."""
        return s.longitudinal_velocity * s.time / s.dynamic_rolling_radius

    def term(self, s: Symbols) -> ca.SX:
        """Variation of the force."""
        return self.variation(s)


class ShaftOrder(RotationalOrder, Addition):
    r"""Output plus :math:`A_c \cos\theta + A_s \sin\theta`, :math:`\theta = \Omega t + \theta_0`: a part that rotates.

    Unbalance of a shaft, ripple of a motor's torque, pulsation of a pump. Every test states the part's speed
    :math:`\Omega` as ``rotational_speed`` [rad/s]; ``shaft_angle`` states its angle, see `RotationalOrder`.
    Fingerprint: one line at :math:`\Omega / (2 \pi)`, whatever the input does.
    """

    name = "shaft_order"
    title = "once-per-turn variation of a rotating part"
    on = ("output",)
    parameters = tuple(
        Parameter(
            f"A_o{suffix}", TARGET_UNIT, -500.0, 500.0, 14.0, description=f"{part} of the variation", neutral=0.0,
            scales=powers(output=1),
        )
        for suffix, part in (("c", "cosine"), ("s", "sine"))
    )  # fmt: skip
    part, suffix = "shaft", "o"
    angle = Condition("shaft_angle", "rad", 0.0, "angle of the shaft at the first sample")
    conditions = (Condition("rotational_speed", "rad/s", None, "rotational speed"), angle)
    amplitude = Parameter(
        "A_o", TARGET_UNIT, 0.0, 500.0, 20.0, description="amplitude of the variation", neutral=0.0,
        scales=powers(output=1),
    )  # fmt: skip

    def turned(self, s: Symbols) -> ca.SX:
        """By the stated speed."""
        return s.rotational_speed * s.time

    def term(self, s: Symbols) -> ca.SX:
        """Variation of the output."""
        return self.variation(s)


class DrumRunout(RotationalOrder, Scaling):
    r"""Load, and the contact patch's force with it, times :math:`1 + m_c \cos\theta + m_s \sin\theta`.

    :math:`\theta = v t / R + \theta_0` with the drum's radius :math:`R`, 0.61 m where the file does not state it
    (4.35 Hz at 60 km/h); ``drum_phase`` states its angle, see `RotationalOrder`. Fingerprint: sidebands of the drum
    order, ± f.
    """

    name = "drum_runout"
    title = "run-out of the drum"
    on = ("slip_stiffness",)
    needs = ("longitudinal_velocity",)
    parameters = (
        Parameter("m_dc", "1", -0.3, 0.3, 0.0057, description="cosine of the load's modulation", neutral=0.0),
        Parameter("m_ds", "1", -0.3, 0.3, 0.0057, description="sine of the load's modulation", neutral=0.0),
    )
    part, suffix = "drum", "d"
    angle = Condition("drum_phase", "rad", 0.0, "angle of the drum at the first sample")
    conditions = (Condition("drum_radius", "m", 0.61, "radius of the drum"), angle)
    amplitude = Parameter("m_d", "1", 0.0, 0.3, 0.008, description="amplitude of the load's modulation", neutral=0.0)

    def turned(self, s: Symbols) -> ca.SX:
        """By speed and radius of the drum."""
        return s.longitudinal_velocity * s.time / s.drum_radius

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Modulation of the load."""
        return self.variation(s)
