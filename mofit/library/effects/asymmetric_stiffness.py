"""Stiffness that differs between the two directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class AsymmetricStiffness(Effect):
    r"""Spring force plus :math:`k_a |y|` [N]: stiffness :math:`k + k_a` one way, :math:`k - k_a` the other.

    Fingerprint: even harmonics.
    """

    name = "asymmetric_stiffness"
    title = "asymmetric stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (Parameter("k_a", "N/m", -5e4, 5e4, 1.2e3, description="half the difference", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the even term."""
        return Applied(value + s.k_a * ca.fabs(s.quantities["deflection"]))
