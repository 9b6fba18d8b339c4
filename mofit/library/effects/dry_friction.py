"""Dry friction after Dahl."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class DryFriction(Effect):
    r"""A force :math:`F_d z` [N] beside the damper, :math:`\delta_d \dot z = \dot y - |\dot y| z`.

    Dahl, "A solid friction model", 1968. Fingerprint: odd harmonics from the third, whatever the frequency, fading
    with amplitude. Where the rate follows from a balance of forces (tyres), the force lowers it by the mobility.
    """

    name = "dry_friction"
    title = "dry friction (Dahl)"
    on = ("deflection_rate", "damper_force")
    parameters = (
        Parameter("F_d", "N", 0.0, 1e3, 30.0, description="friction force", neutral=0.0),
        Parameter("delta_d", "m", 1e-5, 5e-2, 2e-3, "log", "length over which it builds up", grid=(5e-4, 2e-3, 8e-3)),
    )
    states = (Channel("friction", "1", "share of the friction force, z"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the friction."""
        mobility = s.quantities.get("deflection_mobility")
        force = s.F_d * s.friction
        changed = value + force if mobility is None else value - mobility * force
        rate = s.velocity if mobility is None else changed
        return Applied(changed, rates={"friction": (rate - ca.fabs(rate) * s.friction) / s.delta_d})
