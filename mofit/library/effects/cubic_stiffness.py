"""Cubic stiffness."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class CubicStiffness(Effect):
    r"""Spring force plus :math:`k_c y^3` [N]; positive: hardening. Third harmonic, growing with amplitude."""

    name = "cubic_stiffness"
    title = "cubic stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (Parameter("k_c", "N/m^3", -1e9, 1e9, 2.2e7, description="cubic stiffness", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the cubic term."""
        return Applied(value + s.k_c * s.quantities["deflection"] ** 3)
