"""The paper's tyre model: carcass spring, damper and one Maxwell branch in parallel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.kelvin_voigt_tyre import TYRE_STAGES, resting_deflection, tyre_motion
from mofit.library.quasi_static_spring import SPRING_PARAMETERS
from mofit.library.tmeasy import ROLLING_CONDITIONS, TMEASY_PARAMETERS
from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

# wide as the area that the paper searched: its Figure 9 and Table 3
DYNAMIC_PARAMETERS = (
    Parameter("d_y", "N s/m", 0.0, 750.0, 300.0, description="damping of the carcass"),
    Parameter("c_M", "N/m", 1e3, 6e4, 2e4, "log", "stiffness of the Maxwell branch"),
    Parameter("d_M", "N s/m", 500.0, 6e4, 8e3, "log", "damping of the Maxwell branch"),
)


class MaxwellTyre(Model):
    r"""Lateral tyre force with dynamic hardening.

    .. math::
        (v^* d_y + f_G) \, \dot y &= -v^* c_y (1 + p_y |y|) y - v^* c_M (y - y_M) + f_G v^* s \\
        d_M \dot y_M &= c_M (y - y_M) \\
        F &= c_y (1 + p_y |y|) y + c_M (y - y_M) + d_y \dot y

    Slip angle [rad] in, lateral force [N] out; both positive together. States: lateral deflection :math:`y` and
    internal displacement :math:`y_M` of the branch [m], at rest at the start.

    Notes
    -----
    Eqs. (5), (6) and (16) of Hackl et al., "Parametrisation of a Maxwell model for transient tyre forces by means of
    an extended firefly algorithm", Advances in Mechanical Engineering 2016. Eq. (2) as printed repeats the Maxwell
    force (:math:`d_M \dot y_M` is :math:`c_M (y - y_M)`) and misses the damper :math:`d_y \dot y`; eqs. (1), (5) and
    (6) agree with the force above.
    """

    name = "maxwell_tyre"
    title = "Maxwell tyre"
    parameters = (*TMEASY_PARAMETERS, *SPRING_PARAMETERS, *DYNAMIC_PARAMETERS)
    states = (
        Channel("lateral_deflection", "m", "lateral deflection of the carcass"),
        Channel("branch_displacement", "m", "internal displacement of the Maxwell branch"),
    )
    inputs = (Channel("slip_angle", "rad", "slip angle"),)
    outputs = (Channel("lateral_force", "N", "lateral force"),)
    conditions = ROLLING_CONDITIONS
    procedures = ("sine",)
    baseline = "kelvin_voigt_tyre"
    stages = TYRE_STAGES

    def equations(self, s: Symbols) -> Equations:
        """Two states: the deflection and the branch."""
        y = s.quantity("deflection", s.lateral_deflection)
        stretch = y - s.branch_displacement
        rate, force = tyre_motion(s, y, s.quantity("maxwell_force", s.c_M * stretch))
        rest = resting_deflection(s)
        return Equations(
            outputs={"lateral_force": force},
            rates={"lateral_deflection": rate, "branch_displacement": s.c_M / s.d_M * stretch},
            initial={"lateral_deflection": rest, "branch_displacement": rest},
        )
