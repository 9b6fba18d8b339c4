"""Constant force (tyres: conicity; transducers: zero drift)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class ForceOffset(Effect):
    """Force plus a constant [N]. Fingerprint: mean value only."""

    name = "force_offset"
    title = "force offset"
    on = ("lateral_force", "force")
    parameters = (Parameter("F_off", "N", -500.0, 500.0, 25.0, description="offset of the force", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with its offset."""
        return Applied(value + s.F_off)
