"""Side force of an inclined wheel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Condition, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class Camber(Effect):
    r"""Slip angle :math:`\alpha + \epsilon \gamma` with the test's camber angle.

    :math:`\epsilon` is camber stiffness over cornering stiffness, 0.05 to 0.1 for car tyres (Pacejka, "Tire and
    Vehicle Dynamics"). At one camber angle it is a slip-angle offset, hence taken into account only when asked for.
    """

    name = "camber"
    title = "camber"
    on = ("slip_angle",)
    parameters = (
        Parameter("epsilon_c", "1", -0.5, 0.5, 0.08, description="camber over cornering stiffness", neutral=0.0),
    )
    conditions = (Condition("camber_angle", "rad", 0.0, "camber angle"),)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle that has the same force without camber."""
        return Applied(value + s.epsilon_c * s.camber_angle)
