"""First-order tyre dynamics: carcass spring and damper in parallel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.library.quasi_static_spring import SPRING_PARAMETERS, carcass_force
from mofit.library.tmeasy import ROLLING_CONDITIONS, TMEASY_PARAMETERS, lateral_slip, slip_stiffness
from mofit.model import Channel, Equations, Model, Stage
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

# without a branch the damper stands for all of the carcass's loss, and needs more room than the paper's 750 N s/m
DAMPER = Parameter("d_y", "N s/m", 0.0, 3000.0, 300.0, description="damping of the carcass")

TYRE_STAGES = (
    Stage("steady_state", "tmeasy_curve", ("step",), settled=True),
    Stage("spring", "quasi_static_spring", ("quasi_static",)),
)


def tyre_motion(s: Symbols, y: ca.SX, extra_force: ca.SX | float = 0.0) -> tuple[ca.SX, ca.SX]:
    r"""Rate of the deflection ``y`` [m/s] and lateral force [N] of a tyre with any force :math:`F_x` in parallel.

    Eq. (1), contact patch, equals the force law, carcass:

    .. math::
        F = f_G \left(s - \frac{\dot y}{v^*}\right) = F_c(y) + F_x + d_y \dot y
        \quad\Rightarrow\quad
        \dot y = \frac{v^*}{v^* d_y + f_G} \, \bigl(f_G s - F_c - F_x\bigr)

    which is eq. (5). Announces ``elastic_force`` (:math:`F_c + F_x`), ``slip_stiffness``, ``steady_state_force``,
    ``deflection_mobility`` (:math:`\dot y` per newton, m/(N s)), ``deflection_rate`` and ``damper_force``. The force
    returned is that of the contact patch, so that an effect on the rate (a force in parallel that depends on it)
    reaches the output too.
    """
    # the carcass first: what the force does to the slip (compliance, load) then knows it
    elastic = s.quantity("elastic_force", carcass_force(s, y) + extra_force)
    slip, transport = lateral_slip(s)
    slope = s.quantity("slip_stiffness", slip_stiffness(s, slip))
    steady = s.quantity("steady_state_force", slope * slip)
    mobility = s.quantity("deflection_mobility", transport / (transport * s.d_y + slope))
    rate = s.quantity("deflection_rate", mobility * (steady - elastic))
    s.quantity("damper_force", s.d_y * rate)
    return rate, steady - slope * rate / transport


def contact_force(s: Symbols, slope: ca.SX, slip: ca.SX, transport: ca.SX) -> ca.SX:
    r"""Lateral force [N] of the model at its present deflection and another slip, for effects that need it early.

    The two equations of `tyre_motion` without the rate:
    :math:`F = f_G \, (F_c + F_x + d_y v^* s) / (v^* d_y + f_G)`.
    """
    return slope * (s.quantities["elastic_force"] + s.d_y * transport * slip) / (transport * s.d_y + slope)


def resting_deflection(s: Symbols) -> ca.SX:
    r"""Deflection [m] at rest under the first slip angle.

    :math:`c_y (1 + p_y |y|) y = F` with :math:`F = f_G s` gives
    :math:`y = 2 F / \bigl(c_y (1 + \sqrt{1 + 4 p_y |F| / c_y})\bigr)`. To be called after `tyre_motion`.
    """
    force = s.quantities["steady_state_force"]
    # a degressive spring has a largest force; beyond it, start from where that force is reached
    root = ca.sqrt(ca.fmax(1 + 4 * s.p_y * ca.fabs(force) / s.c_y, 1e-4))
    return 2 * force / (s.c_y * (1 + root))


class KelvinVoigtTyre(Model):
    r"""Lateral tyre force with a non-linear carcass spring and a damper: Rill's first-order model.

    .. math::
        (v^* d_y + f_G) \, \dot y = -v^* c_y (1 + p_y |y|) y + f_G v^* s, \qquad
        F = c_y (1 + p_y |y|) y + d_y \dot y

    Slip angle [rad] in, lateral force [N] out; both positive together. State: lateral deflection :math:`y` [m], at
    rest at the start. Eqs. (5), (16) of Hackl et al. 2016 without the Maxwell branch.
    """

    name = "kelvin_voigt_tyre"
    title = "Kelvin–Voigt tyre"
    parameters = (*TMEASY_PARAMETERS, *SPRING_PARAMETERS, DAMPER)
    states = (Channel("lateral_deflection", "m", "lateral deflection of the carcass"),)
    inputs = (Channel("slip_angle", "rad", "slip angle"),)
    outputs = (Channel("lateral_force", "N", "lateral force"),)
    conditions = ROLLING_CONDITIONS
    procedures = ("sine",)
    stages = TYRE_STAGES

    def equations(self, s: Symbols) -> Equations:
        """One state: the deflection."""
        rate, force = tyre_motion(s, s.quantity("deflection", s.lateral_deflection))
        return Equations(
            outputs={"lateral_force": force},
            rates={"lateral_deflection": rate},
            initial={"lateral_deflection": resting_deflection(s)},
        )
