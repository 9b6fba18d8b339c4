"""Hysteresis after Bouc and Wen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class BoucWen(Effect):
    r"""A hysteretic force :math:`F_w z` [N] beside the damper.

    .. math::
        \delta_w \dot z = \dot y - \tfrac12 (|\dot y| z + \dot y |z|)

    Wen, J. Eng. Mech. Div. 102 (1976), with exponent 1: unlike Dahl's friction it unloads along a straight line. Few
    data tell the two apart, hence taken into account only when asked for. Where the rate follows from a balance of
    forces (tyres), the force lowers it by the mobility.
    """

    name = "bouc_wen"
    title = "hysteresis (Bouc–Wen)"
    on = ("deflection_rate", "damper_force")
    parameters = (
        Parameter("F_w", "N", 0.0, 1e3, 30.0, description="yield force of the hysteresis", neutral=0.0),
        Parameter("delta_w", "m", 1e-5, 5e-2, 2e-3, "log", "its yield length", grid=(5e-4, 2e-3, 8e-3)),
    )
    states = (Channel("hysteresis", "1", "share of the yield force, z"),)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the hysteresis."""
        z, mobility = s.hysteresis, s.quantities.get("deflection_mobility")
        changed = value + s.F_w * z if mobility is None else value - mobility * s.F_w * z
        rate = s.velocity if mobility is None else changed
        return Applied(changed, rates={"hysteresis": (rate - (ca.fabs(rate) * z + rate * ca.fabs(z)) / 2) / s.delta_w})
