"""The drum is out of round and modulates the load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Channel, Condition, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class DrumRunout(Effect):
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
    inputs = (Channel("time", "s", "time since the first sample"),)
    conditions = (
        Condition("drum_radius", "m", 0.61, "radius of the drum"),
        Condition("drum_phase", "rad", 0.0, "angle of the drum at the first sample"),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slope of the contact patch under the modulated load."""
        angle = s.longitudinal_velocity * s.time / s.drum_radius + s.drum_phase
        return Applied(value * (1 + s.m_dc * ca.cos(angle) + s.m_ds * ca.sin(angle)))
