"""Softening of filled rubber with amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class Payne(Effect):
    r"""Spring force plus :math:`c_P y / (1 + |y| / y_P)` [N]: stiffness that is lost beyond a deflection :math:`y_P`.

    The filler network of rubber breaks with strain (Payne, J. Appl. Polym. Sci. 6, 1962). Fingerprint: stiffness that
    falls with amplitude, odd harmonics whatever the frequency.
    """

    name = "payne"
    title = "Payne softening"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter("c_P", "N/m", 0.0, 1e5, 1e4, description="stiffness that is lost with amplitude", neutral=0.0),
        Parameter(
            "y_P", "m", 1e-4, 0.1, 3e-3, "log", "deflection at which half of it is lost", grid=(1e-3, 3e-3, 1e-2)
        ),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the softening part."""
        y = s.quantities["deflection"]
        return Applied(value + s.c_P * y / (1 + ca.fabs(y) / s.y_P))
