"""Force variation once per turn of the wheel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Channel, Condition, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class WheelOrder(Effect):
    r"""Force plus :math:`A_c \cos\theta + A_s \sin\theta` [N], :math:`\theta = v t / r + \theta_0`: non-uniformity.

    Fingerprint: one line at :math:`v / (2 \pi r)`, 8.7 Hz at 60 km/h, whatever the steer does. Each test's wheel
    angle at its first sample is the condition ``wheel_phase``, 0 where the file does not state it.
    """

    name = "wheel_order"
    title = "force variation of the wheel"
    on = ("lateral_force",)
    needs = ("longitudinal_velocity",)
    parameters = (
        Parameter("A_wc", "N", -500.0, 500.0, 14.0, description="cosine of the force variation", neutral=0.0),
        Parameter("A_ws", "N", -500.0, 500.0, 14.0, description="sine of the force variation", neutral=0.0),
    )
    inputs = (Channel("time", "s", "time since the first sample"),)
    conditions = (
        Condition("dynamic_rolling_radius", "m", 0.305, "radius that the wheel turns with"),
        Condition("wheel_phase", "rad", 0.0, "angle of the wheel at the first sample"),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with its variation."""
        angle = s.longitudinal_velocity * s.time / s.dynamic_rolling_radius + s.wheel_phase
        return Applied(value + s.A_wc * ca.cos(angle) + s.A_ws * ca.sin(angle))
