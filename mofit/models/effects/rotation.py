"""Once per turn of what rotates: wheel and drum."""

from __future__ import annotations

import casadi as ca

from mofit.models.declarations import TIME, Condition
from mofit.models.effect import Addition, Scaling
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter


class WheelOrder(Addition):
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
    inputs = (TIME,)
    conditions = (
        Condition("dynamic_rolling_radius", "m", 0.305, "radius that the wheel turns with"),
        Condition("wheel_phase", "rad", 0.0, "angle of the wheel at the first sample"),
    )

    def term(self, s: Symbols) -> ca.SX:
        """Variation of the force."""
        angle = s.longitudinal_velocity * s.time / s.dynamic_rolling_radius + s.wheel_phase
        return s.A_wc * ca.cos(angle) + s.A_ws * ca.sin(angle)


class DrumRunout(Scaling):
    r"""Load, and the contact patch's force with it, times :math:`1 + m_c \cos\theta + m_s \sin\theta`.

    :math:`\theta = v t / R + \theta_0` with the drum's radius :math:`R`, 0.61 m where the file does not state it
    (4.35 Hz at 60 km/h), and its angle at the first sample. Fingerprint: sidebands of the drum order, ± f.
    """

    name = "drum_runout"
    title = "run-out of the drum"
    on = ("slip_stiffness",)
    needs = ("longitudinal_velocity",)
    parameters = (
        Parameter("m_dc", "1", -0.3, 0.3, 0.0057, description="cosine of the load's modulation", neutral=0.0),
        Parameter("m_ds", "1", -0.3, 0.3, 0.0057, description="sine of the load's modulation", neutral=0.0),
    )
    inputs = (TIME,)
    conditions = (
        Condition("drum_radius", "m", 0.61, "radius of the drum"),
        Condition("drum_phase", "rad", 0.0, "angle of the drum at the first sample"),
    )

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Modulation of the load."""
        angle = s.longitudinal_velocity * s.time / s.drum_radius + s.drum_phase
        return s.m_dc * ca.cos(angle) + s.m_ds * ca.sin(angle)
