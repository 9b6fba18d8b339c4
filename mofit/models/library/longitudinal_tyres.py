"""Longitudinal tyre forces, static and transient: the twins of the lateral models, over the slip ratio."""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca

from mofit.models.library.steady_state import (
    LOAD,
    ROLLING_CONDITIONS,
    TYPICAL_LOAD,
    Direction,
    carcass_force,
    slip_stiffness,
)
from mofit.models.library.tyres import resting_deflection, tyre_motion
from mofit.models.model import Channel, Equations, MaxwellBranch, Model, Stage, Symbols
from mofit.parameters import Parameter

SLIP_RATIO = Channel("slip_ratio", "1", "longitudinal slip ratio")
LONGITUDINAL_FORCE = Channel("longitudinal_force", "N", "longitudinal force")
DEFLECTION_X = Channel("longitudinal_deflection", "m", "longitudinal deflection of the carcass")
BRANCH_X = Channel("branch_displacement_x", "m", "internal displacement of the longitudinal Maxwell branch")

#: a wheel at 60 km/h whose slip ratio runs from -5 % to 5 %
TYPICAL_BRAKING = MappingProxyType({**TYPICAL_LOAD, "slip_ratio": 0.1, "longitudinal_velocity": 60 / 3.6})

CURVE_X_PARAMETERS = (
    Parameter("dF0_x", "N", 1e4, 5e5, 9e4, "log", "initial slope of longitudinal force over slip", scales=LOAD),
    Parameter("s_Mx", "1", 0.03, 1.0, 0.11, "log", "longitudinal slip at the maximum force"),
    Parameter("F_Mx", "N", 300.0, 2e4, 3300.0, "log", "maximum longitudinal force", scales=LOAD),
)
SPRING_X_PARAMETERS = (
    Parameter("c_x", "N/m", 5e4, 1.5e6, 3e5, "log", "longitudinal stiffness at small deflection", scales=LOAD),
    Parameter("p_x", "1/m", -60.0, 60.0, -5.0, description="change of longitudinal stiffness with deflection"),
)
BRANCH_X_PARAMETERS = (
    Parameter("c_Mx", "N/m", 5e3, 2e5, 5e4, "log", "stiffness of the longitudinal Maxwell branch", scales=LOAD),
    Parameter("d_Mx", "N s/m", 500.0, 6e4, 5e3, "log", "damping of the longitudinal Maxwell branch", scales=LOAD),
)


def longitudinal_slip(s: Symbols) -> tuple[ca.SX, ca.SX]:
    r"""Normalised longitudinal slip and transport velocity of a wheel that runs straight on.

    With the slip ratio :math:`\kappa = (r_D \Omega - v) / v` of the measurement

    .. math::
        v^* = |v (1 + \kappa)| \, \hat s + v_N, \qquad s = \frac{-(v - r_D \Omega)}{v^*} = \frac{v \kappa}{v^*}

    Rill relates the sliding velocity to :math:`r_D |\Omega|`, so that a locked wheel has a large slip, not -1.

    Returns
    -------
    slip
        [1], positive for a driven wheel; quantity ``longitudinal_slip``.
    transport_velocity
        [m/s]; quantity ``transport_velocity``.
    """
    ratio, speed = s.slip_ratio, s.longitudinal_velocity
    transport = s.quantity(
        "transport_velocity", ca.fabs(speed * (1 + ratio)) * s.slip_normalisation + s.fictitious_velocity
    )
    return s.quantity("longitudinal_slip", speed * ratio / transport), transport


LONGITUDINAL = Direction(longitudinal_slip, ("dF0_x", "s_Mx", "F_Mx"), ("c_x", "p_x", "d_x"))


def damping_x(upper: float) -> Parameter:
    """Damping of the carcass in parallel with its spring, up to ``upper`` N s/m."""
    return Parameter("d_x", "N s/m", 0.0, upper, 300.0, description="longitudinal damping of the carcass", scales=LOAD)


class TMeasyCurveLongitudinal(Model):
    r"""Steady-state longitudinal force :math:`F = f_G(s) \, s`; see `longitudinal_slip` and `slip_stiffness`.

    A positive slip ratio (a driven wheel) gives a positive longitudinal force [N]. The rising part (dF0_x, s_Mx, F_Mx)
    is identified; sliding is in fixed ratios to it.
    """

    name = "tmeasy_curve_longitudinal"
    title = "longitudinal TMeasy steady-state curve"
    typical = TYPICAL_BRAKING
    parameters = CURVE_X_PARAMETERS
    inputs = (SLIP_RATIO,)
    outputs = (LONGITUDINAL_FORCE,)
    conditions = ROLLING_CONDITIONS

    def equations(self, s: Symbols) -> Equations:
        """Force of the settled tyre."""
        slip, _ = longitudinal_slip(s)
        force = s.quantity("steady_state_force", slip_stiffness(LONGITUDINAL.curve(s), slip) * slip)
        return Equations(outputs={"longitudinal_force": force})


class QuasiStaticSpringLongitudinal(Model):
    r"""Non-linear spring :math:`F = c_x x + c_x p_x |x| x` of the standing tyre.

    Eq. (16) of Hackl et al. 2016 for the longitudinal direction: displacement [m] so slow that dampers carry nothing,
    force [N].
    """

    name = "quasi_static_spring_longitudinal"
    title = "quasi-static longitudinal spring"
    typical = TYPICAL_LOAD
    parameters = SPRING_X_PARAMETERS
    inputs = (Channel("longitudinal_displacement", "m", "longitudinal displacement"),)
    outputs = (LONGITUDINAL_FORCE,)

    def equations(self, s: Symbols) -> Equations:
        """Spring force."""
        x = s.quantity("deflection", s.longitudinal_displacement)
        return Equations(outputs={"longitudinal_force": carcass_force(s, x, LONGITUDINAL)})


class LongitudinalTyre(Model):
    """What the longitudinal models share: slip ratio in, longitudinal force [N] out, both positive together."""

    inputs = (SLIP_RATIO,)
    outputs = (LONGITUDINAL_FORCE,)
    conditions = ROLLING_CONDITIONS
    typical = TYPICAL_BRAKING
    excitations = ("ramp", "sine", "chirp", "multisine", "free")
    stages = (
        Stage("steady_state", "steady state", TMeasyCurveLongitudinal.name, ("step",), settled=True),
        Stage("spring", "spring", QuasiStaticSpringLongitudinal.name, ("quasi_static",)),
    )


class KelvinVoigtTyreLongitudinal(LongitudinalTyre):
    r"""Longitudinal tyre force with a non-linear carcass spring and a damper: Rill's first-order model.

    .. math::
        (v^* d_x + f_G) \, \dot x = -v^* c_x (1 + p_x |x|) x + f_G v^* s, \qquad
        F = c_x (1 + p_x |x|) x + d_x \dot x

    State: longitudinal deflection :math:`x` [m], at rest at the start. The Kelvin–Voigt tyre with the slip of
    `longitudinal_slip`.
    """

    name = "kelvin_voigt_tyre_longitudinal"
    title = "longitudinal Kelvin–Voigt tyre"
    parameters = (*CURVE_X_PARAMETERS, *SPRING_X_PARAMETERS, damping_x(6000.0))
    states = (DEFLECTION_X,)

    def equations(self, s: Symbols) -> Equations:
        """One state: the deflection."""
        x = s.quantity("deflection", s.longitudinal_deflection)
        rate, force = tyre_motion(s, x, direction=LONGITUDINAL)
        return Equations(
            outputs={"longitudinal_force": force},
            derivatives={"longitudinal_deflection": rate},
            initial={"longitudinal_deflection": resting_deflection(s, LONGITUDINAL)},
        )


class MaxwellTyreLongitudinal(LongitudinalTyre):
    r"""Longitudinal tyre force with dynamic hardening: one Maxwell branch in parallel.

    .. math::
        (v^* d_x + f_G) \, \dot x &= -v^* c_x (1 + p_x |x|) x - v^* c_M (x - x_M) + f_G v^* s \\
        d_M \dot x_M &= c_M (x - x_M) \\
        F &= c_x (1 + p_x |x|) x + c_M (x - x_M) + d_x \dot x

    States: longitudinal deflection :math:`x` and internal displacement :math:`x_M` of the branch [m], at rest at the
    start. The Maxwell tyre of Hackl et al. 2016 with the slip of `longitudinal_slip`; :math:`c_M` and :math:`d_M` are
    ``c_Mx`` and ``d_Mx``.
    """

    name = "maxwell_tyre_longitudinal"
    title = "longitudinal Maxwell tyre"
    parameters = (*CURVE_X_PARAMETERS, *SPRING_X_PARAMETERS, damping_x(1500.0), *BRANCH_X_PARAMETERS)
    states = (DEFLECTION_X, BRANCH_X)
    baseline = KelvinVoigtTyreLongitudinal.name
    branches = (MaxwellBranch("c_Mx", "d_Mx", parallel=("c_x", "d_x"), part="carcass"),)
    default = True

    def equations(self, s: Symbols) -> Equations:
        """Two states: the deflection and the branch."""
        x = s.quantity("deflection", s.longitudinal_deflection)
        stretch = x - s.branch_displacement_x
        rate, force = tyre_motion(s, x, s.quantity("maxwell_force", s.c_Mx * stretch), LONGITUDINAL)
        rest = resting_deflection(s, LONGITUDINAL)
        return Equations(
            outputs={"longitudinal_force": force},
            derivatives={"longitudinal_deflection": rate, "branch_displacement_x": s.c_Mx / s.d_Mx * stretch},
            initial={"longitudinal_deflection": rest, "branch_displacement_x": rest},
        )
