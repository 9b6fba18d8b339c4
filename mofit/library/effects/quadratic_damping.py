"""Damping that grows with the square of speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class QuadraticDamping(Effect):
    r"""A force :math:`d_2 \dot y |\dot y|` [N] beside the damper. Fingerprint: third harmonic, grows with f².

    Where the rate follows from a balance of forces (tyres: :math:`\dot y_0 = \mu R` with the mobility :math:`\mu`),
    it solves :math:`\dot y + \mu d_2 \dot y |\dot y| = \dot y_0`, that is
    :math:`\dot y = 2 \dot y_0 / (1 + \sqrt{1 + 4 \mu d_2 |\dot y_0|})`.
    """

    name = "quadratic_damping"
    title = "quadratic damping"
    on = ("deflection_rate", "damper_force")
    parameters = (Parameter("d_2", "N s^2/m^2", 0.0, 1e5, 300.0, description="quadratic damping", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the quadratic force."""
        mobility = s.quantities.get("deflection_mobility")
        if mobility is None:
            return Applied(value + s.d_2 * s.velocity * ca.fabs(s.velocity))
        return Applied(2 * value / (1 + ca.sqrt(1 + 4 * mobility * s.d_2 * ca.fabs(value))))
