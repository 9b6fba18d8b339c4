"""Lateral spring of the standing or slowly moved tyre."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

SPRING_PARAMETERS = (
    Parameter("c_y", "N/m", 1e4, 1e6, 1.2e5, "log", "lateral stiffness at small deflection"),
    Parameter("p_y", "1/m", -30.0, 30.0, -7.0, description="change of stiffness with deflection; negative: degressive"),
)


def carcass_force(s: Symbols, y: ca.SX) -> ca.SX:
    """Eq. (16) [N] at deflection ``y`` [m]; quantity ``carcass_force``."""
    return s.quantity("carcass_force", s.c_y * (1 + s.p_y * ca.fabs(y)) * y)


class QuasiStaticSpring(Model):
    r"""Non-linear spring :math:`F = c_y y + c_y p_y |y| y`.

    Eq. (16) of Hackl et al. 2016: displacement [m] so slow that dampers carry nothing, force [N].
    """

    name = "quasi_static_spring"
    title = "quasi-static lateral spring"
    parameters = SPRING_PARAMETERS
    inputs = (Channel("lateral_displacement", "m", "lateral displacement"),)
    outputs = (Channel("lateral_force", "N", "lateral force"),)

    def equations(self, s: Symbols) -> Equations:
        """Spring force."""
        y = s.quantity("deflection", s.lateral_displacement)
        return Equations(outputs={"lateral_force": carcass_force(s, y)})
