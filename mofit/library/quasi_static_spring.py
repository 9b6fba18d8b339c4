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


#: keeps the largest deflection finite, 1/m
_HARDLY_DEGRESSIVE = 1e-6


def carcass_force(s: Symbols, y: ca.SX) -> ca.SX:
    r"""Eq. (16) [N] at deflection ``y`` [m]; quantity ``carcass_force``.

    A degressive spring holds its largest force :math:`c_y / (4 |p_y|)` from :math:`|y| = 1 / (2 |p_y|)` on, where
    eq. (16) alone would turn round and run away.
    """
    largest = 0.5 / ca.fmax(-s.p_y, _HARDLY_DEGRESSIVE)
    held = ca.fmax(-largest, ca.fmin(y, largest))
    return s.quantity("carcass_force", s.c_y * (1 + s.p_y * ca.fabs(held)) * held)


class QuasiStaticSpring(Model):
    r"""Non-linear spring :math:`F = c_y y + c_y p_y |y| y`.

    Eq. (16) of Hackl et al. 2016: displacement [m] so slow that dampers carry nothing, force [N]. A degressive spring
    (:math:`p_y < 0`) holds its largest force from :math:`|y| = 1 / (2 |p_y|)` on.
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
