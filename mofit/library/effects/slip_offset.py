"""Offset of the slip angle (toe, ply steer, alignment)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class SlipOffset(Effect):
    """Slip angle plus a constant [rad]. Fingerprint: mean value and second harmonic."""

    name = "slip_offset"
    title = "slip-angle offset"
    on = ("slip_angle",)
    parameters = (Parameter("alpha_0", "rad", -0.02, 0.02, 0.0014, description="slip-angle offset", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle with its offset."""
        return Applied(value + s.alpha_0)
