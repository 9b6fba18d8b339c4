"""Transient lateral tyre forces: carcass spring and damper, with and without a Maxwell branch."""

from __future__ import annotations

import casadi as ca

from mofit.models.library.steady_state import (
    LATERAL,
    LATERAL_FORCE,
    LOAD,
    ROLLING_CONDITIONS,
    SLIP_ANGLE,
    SPRING_PARAMETERS,
    TMEASY_PARAMETERS,
    TYPICAL_ROLLING,
    Direction,
    carcass_force,
    slip_stiffness,
)
from mofit.models.model import Channel, Equations, MaxwellBranch, Model, Stage, Symbols
from mofit.parameters import Parameter

DEFLECTION = Channel("lateral_deflection", "m", "lateral deflection of the carcass")


def elastic_force(s: Symbols, y: ca.SX, extra_force: ca.SX | float = 0.0, direction: Direction = LATERAL) -> ca.SX:
    r"""Force that the deflection ``y`` alone makes, :math:`F_c(y) + F_x` [N]; quantity ``elastic_force``."""
    return direction.quantity(s, "elastic_force", carcass_force(s, y, direction) + extra_force)


def contact_motion(
    s: Symbols, elastic: ca.SX, slope: ca.SX, slip: ca.SX, transport: ca.SX, direction: Direction = LATERAL
) -> tuple[ca.SX, ca.SX]:
    r"""Rate of the deflection [m/s] and force [N] of a tyre whose contact patch has the secant slope :math:`f_G` [N].

    Eq. (1), contact patch, equals the force law, carcass:

    .. math::
        F = f_G \left(s - \frac{\dot y}{v^*}\right) = F_c(y) + F_x + d_y \dot y
        \quad\Rightarrow\quad
        \dot y = \frac{v^*}{v^* d_y + f_G} \, \bigl(f_G s - F_c - F_x\bigr)

    which is eq. (5). Announces ``steady_state_force``, ``deflection_mobility`` (:math:`\dot y` per newton, m/(N s)),
    ``deflection_rate`` and ``damper_force``. The force returned is that of the contact patch, so that an effect on the
    rate (a force in parallel that depends on it) reaches the output too.
    """
    damping = direction.damping(s)
    steady = direction.quantity(s, "steady_state_force", slope * slip)
    mobility = direction.quantity(s, "deflection_mobility", transport / (transport * damping + slope))
    rate = direction.quantity(s, "deflection_rate", mobility * (steady - elastic))
    direction.quantity(s, "damper_force", damping * rate)
    return rate, steady - slope * rate / transport


def tyre_motion(
    s: Symbols, y: ca.SX, extra_force: ca.SX | float = 0.0, direction: Direction = LATERAL
) -> tuple[ca.SX, ca.SX]:
    r"""`contact_motion` of a tyre with slip in one direction, at deflection ``y`` [m].

    Any force :math:`F_x` in parallel is ``extra_force``. Announces ``slip_stiffness``, too.
    """
    # the carcass first: what the force does to the slip (compliance, load) needs it
    elastic = elastic_force(s, y, extra_force, direction)
    slip, transport = direction.slip(s)
    slope = direction.quantity(s, "slip_stiffness", slip_stiffness(direction.curve(s), slip))
    return contact_motion(s, elastic, slope, slip, transport, direction)


def contact_force(s: Symbols, slope: ca.SX, slip: ca.SX, transport: ca.SX) -> ca.SX:
    r"""Lateral force [N] of the model at its present deflection and another slip, for effects that need it early.

    The two equations of `contact_motion` without the rate:
    :math:`F = f_G \, (F_c + F_x + d_y v^* s) / (v^* d_y + f_G)`.
    """
    return slope * (s.quantities["elastic_force"] + s.d_y * transport * slip) / (transport * s.d_y + slope)


def resting_deflection(s: Symbols, direction: Direction = LATERAL) -> ca.SX:
    r"""Deflection [m] at rest under the first slip angle.

    :math:`c_y (1 + p_y |y|) y = F` with :math:`F = f_G s` gives
    :math:`y = 2 F / \bigl(c_y (1 + \sqrt{1 + 4 p_y |F| / c_y})\bigr)`. To be called after `contact_motion`.
    """
    force = s.quantities[direction.prefix + "steady_state_force"]
    stiffness, change = direction.stiffness(s)
    # a degressive spring has a largest force; beyond it, start from where that force is reached
    root = ca.sqrt(ca.fmax(1 + 4 * change * ca.fabs(force) / stiffness, 1e-4))
    return 2 * force / (stiffness * (1 + root))


class Tyre(Model):
    """What the tyre models share: slip angle [rad] in, lateral force [N] out, both positive together."""

    inputs = (SLIP_ANGLE,)
    outputs = (LATERAL_FORCE,)
    conditions = ROLLING_CONDITIONS
    typical = TYPICAL_ROLLING
    excitations = ("ramp", "sine", "chirp", "multisine", "free")
    stages = (
        Stage("steady_state", "steady state", "tmeasy_curve", ("step",), settled=True),
        Stage("spring", "spring", "quasi_static_spring", ("quasi_static",)),
    )


class KelvinVoigtTyre(Tyre):
    r"""Lateral tyre force with a non-linear carcass spring and a damper: Rill's first-order model.

    .. math::
        (v^* d_y + f_G) \, \dot y = -v^* c_y (1 + p_y |y|) y + f_G v^* s, \qquad
        F = c_y (1 + p_y |y|) y + d_y \dot y

    State: lateral deflection :math:`y` [m], at rest at the start. Eqs. (5), (16) of Hackl et al. 2016 without the
    Maxwell branch.
    """

    name = "kelvin_voigt_tyre"
    title = "Kelvin–Voigt tyre"
    parameters = (
        *TMEASY_PARAMETERS,
        *SPRING_PARAMETERS,
        # without a branch the damper is the only loss of the carcass, and needs more room than the paper's 750
        Parameter("d_y", "N s/m", 0.0, 3000.0, 300.0, description="damping of the carcass", scales=LOAD),
    )
    states = (DEFLECTION,)

    def equations(self, s: Symbols) -> Equations:
        """One state: the deflection."""
        rate, force = tyre_motion(s, s.quantity("deflection", s.lateral_deflection))
        return Equations(
            outputs={"lateral_force": force},
            derivatives={"lateral_deflection": rate},
            initial={"lateral_deflection": resting_deflection(s)},
        )


class MaxwellTyre(Tyre):
    r"""Lateral tyre force with dynamic hardening: one Maxwell branch in parallel.

    .. math::
        (v^* d_y + f_G) \, \dot y &= -v^* c_y (1 + p_y |y|) y - v^* c_M (y - y_M) + f_G v^* s \\
        d_M \dot y_M &= c_M (y - y_M) \\
        F &= c_y (1 + p_y |y|) y + c_M (y - y_M) + d_y \dot y

    States: lateral deflection :math:`y` and internal displacement :math:`y_M` of the branch [m], at rest at the start.

    Notes
    -----
    Eqs. (5), (6) and (16) of Hackl et al., "Parametrisation of a Maxwell model for transient tyre forces by means of
    an extended firefly algorithm", Advances in Mechanical Engineering 2016. Eq. (2) as printed repeats the Maxwell
    force (:math:`d_M \dot y_M` is :math:`c_M (y - y_M)`) and misses the damper :math:`d_y \dot y`; eqs. (1), (5) and
    (6) agree with the force above.
    """

    name = "maxwell_tyre"
    title = "Maxwell tyre"
    parameters = (
        *TMEASY_PARAMETERS,
        *SPRING_PARAMETERS,
        # wide as the area that the paper searched: its Figure 9 and Table 3
        Parameter("d_y", "N s/m", 0.0, 750.0, 300.0, description="damping of the carcass", scales=LOAD),
        Parameter("c_M", "N/m", 1e3, 6e4, 2e4, "log", "stiffness of the Maxwell branch", scales=LOAD),
        Parameter("d_M", "N s/m", 500.0, 6e4, 8e3, "log", "damping of the Maxwell branch", scales=LOAD),
    )
    states = (DEFLECTION, Channel("branch_displacement", "m", "internal displacement of the Maxwell branch"))
    baseline = KelvinVoigtTyre.name
    branches = (MaxwellBranch("c_M", "d_M", parallel=("c_y", "d_y"), part="carcass"),)
    default = True

    def equations(self, s: Symbols) -> Equations:
        """Two states: the deflection and the branch."""
        y = s.quantity("deflection", s.lateral_deflection)
        stretch = y - s.branch_displacement
        rate, force = tyre_motion(s, y, s.quantity("maxwell_force", s.c_M * stretch))
        rest = resting_deflection(s)
        return Equations(
            outputs={"lateral_force": force},
            derivatives={"lateral_deflection": rate, "branch_displacement": s.c_M / s.d_M * stretch},
            initial={"lateral_deflection": rest, "branch_displacement": rest},
        )
