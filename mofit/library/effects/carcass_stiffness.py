"""Another carcass stiffness than in the quasi-static test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class CarcassStiffness(Effect):
    r"""Stiffness :math:`c_y (1 + e)`: pressure, temperature or rolling differ from the quasi-static test.

    Fingerprint: odd harmonics, growing with f as the lag of the carcass does.
    """

    name = "carcass_stiffness"
    title = "error of the carcass stiffness"
    on = ("c_y",)
    parameters = (
        Parameter("e_y", "1", -0.5, 0.5, 0.06, description="relative error of the carcass stiffness", neutral=0.0),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Stiffness in the tests at hand."""
        return Applied((1 + s.e_y) * value)
