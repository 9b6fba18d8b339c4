"""Longitudinal and lateral tyre forces together: two twins whose contact patches share one generalised slip."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import casadi as ca

from mofit.models.library.longitudinal_tyres import (
    BRANCH_X,
    BRANCH_X_PARAMETERS,
    CURVE_X_PARAMETERS,
    DEFLECTION_X,
    LONGITUDINAL,
    LONGITUDINAL_FORCE,
    SLIP_RATIO,
    SPRING_X_PARAMETERS,
    TYPICAL_BRAKING,
    damping_x,
)
from mofit.models.library.steady_state import (
    LATERAL,
    LATERAL_FORCE,
    ROLLING_CONDITIONS,
    SLIP_ANGLE,
    TYPICAL_ROLLING,
    Curve,
    slip_stiffness,
)
from mofit.models.library.tyres import DEFLECTION, MaxwellTyre, contact_motion, elastic_force, resting_deflection
from mofit.models.model import Channel, Equations, MaxwellBranch, Model, Symbols

#: the longitudinal direction where the lateral one is beside it
_X = replace(LONGITUDINAL, prefix="longitudinal_")
#: slip below which its direction is not resolved; it keeps the direction regular at zero slip
_NO_SLIP = 1e-9


def normalisation(x: Curve, y: Curve) -> tuple[ca.SX, ca.SX]:
    r"""Rill's slip normalisation factors of both directions, which bring their curves onto one scale.

    .. math::
        \hat s_x = \frac{s_{Mx}}{s_{Mx} + s_{My}} + \frac{F_{Mx} / dF_{0x}}{F_{Mx} / dF_{0x} + F_{My} / dF_{0y}}, \qquad
        \hat s_y = 2 - \hat s_x
    """
    ratio_x, ratio_y = x.F_M / x.dF0, y.F_M / y.dF0
    factor = x.s_M / (x.s_M + y.s_M) + ratio_x / (ratio_x + ratio_y)
    return factor, 2 - factor


def combined_slip(s: Symbols, x: Curve, y: Curve) -> tuple[tuple[ca.SX, ca.SX], tuple[ca.SX, ca.SX], ca.SX]:
    r"""Normalised slip and transport velocity of both directions, and the secant slope over the generalised slip.

    With the slip ratio :math:`\kappa` and the wheel's circumferential velocity
    :math:`r_D |\Omega| = |v \cos\alpha \, (1 + \kappa)|`

    .. math::
        v^*_i &= r_D |\Omega| \, \hat s_i + v_N, \qquad
        s_x = \frac{v \cos\alpha \, \kappa}{v^*_x}, \quad s_y = \frac{v \sin\alpha}{v^*_y} \\
        s &= \sqrt{s_x^2 + s_y^2}, \qquad \cos\varphi = s_x / s, \quad \sin\varphi = s_y / s \\
        dF_0 &= \sqrt{(dF_{0x} \hat s_x \cos\varphi)^2 + (dF_{0y} \hat s_y \sin\varphi)^2} \\
        s_M &= \sqrt{(s_{Mx} / \hat s_x \cos\varphi)^2 + (s_{My} / \hat s_y \sin\varphi)^2} \\
        F_M &= \sqrt{(F_{Mx} \cos\varphi)^2 + (F_{My} \sin\varphi)^2}

    Announces ``longitudinal_slip``, ``longitudinal_transport_velocity``, ``lateral_slip``, ``transport_velocity``,
    ``generalised_slip`` and ``slip_stiffness``.
    """
    angle, speed, norms = s.slip_angle, s.longitudinal_velocity, normalisation(x, y)
    along = speed * ca.cos(angle)
    turning = ca.fabs(along * (1 + s.slip_ratio))
    sliding = (along * s.slip_ratio, speed * ca.sin(angle))
    names = ("longitudinal_transport_velocity", "transport_velocity"), ("longitudinal_slip", "lateral_slip")
    transport = [s.quantity(n, turning * norm + s.fictitious_velocity) for n, norm in zip(names[0], norms, strict=True)]
    slips = [s.quantity(n, v / over) for n, v, over in zip(names[1], sliding, transport, strict=True)]
    square_x, square_y = (_square(v, over) for v, over in zip(sliding, transport, strict=True))
    cosine2 = (square_x + _NO_SLIP**2) / (square_x + square_y + 2 * _NO_SLIP**2)

    def between(in_x: ca.SX, in_y: ca.SX) -> ca.SX:
        return ca.sqrt(in_x**2 * cosine2 + in_y**2 * (1 - cosine2))

    curve = Curve(
        between(x.dF0 * norms[0], y.dF0 * norms[1]), between(x.s_M / norms[0], y.s_M / norms[1]), between(x.F_M, y.F_M)
    )
    size = s.quantity("generalised_slip", ca.sqrt(square_x + square_y + _NO_SLIP**2))
    slope = s.quantity("slip_stiffness", slip_stiffness(curve, size))
    return (slips[0], transport[0]), (slips[1], transport[1]), slope


def _square(velocity: ca.SX, over: ca.SX) -> ca.SX:
    """Square of a slip; its sign stays in it, so that no integration step crosses the kink at zero slip."""
    return (velocity * ca.sign(velocity) / over) ** 2


class MaxwellTyreCombined(Model):
    r"""Longitudinal and lateral force of a tyre with combined slip: the two Maxwell tyres, coupled by TMeasy.

    .. math::
        F_x &= f \left(s_x - \dot x / v^*_x\right)
             = c_x (1 + p_x |x|) x + c_{Mx} (x - x_M) + d_x \dot x, \qquad d_{Mx} \dot x_M = c_{Mx} (x - x_M) \\
        F_y &= f \left(s_y - \dot y / v^*_y\right)
             = c_y (1 + p_y |y|) y + c_M (y - y_M) + d_y \dot y, \qquad d_M \dot y_M = c_M (y - y_M)

    :math:`f = F / s` is the secant slope of the TMeasy curve over the generalised slip (`combined_slip`). With slip in
    one direction only it is that of the direction, and the model is the twin of that direction but for :math:`v_N`.
    Slip ratio and slip angle [rad] in, forces [N] out, each positive with its slip. All parameters are identified at
    once; tests may lack one of the forces.

    References
    ----------
    Rill, "Road Vehicle Dynamics", 2nd ed. (2020), chapter 3 (TMeasy); Rill, "First order tire dynamics", III ECCM 2006.
    """

    name = "maxwell_tyre_combined"
    title = "Maxwell tyre with combined slip"
    parameters = (
        *MaxwellTyre.parameters,
        *CURVE_X_PARAMETERS,
        *SPRING_X_PARAMETERS,
        damping_x(1500.0),
        *BRANCH_X_PARAMETERS,
    )
    states = (
        DEFLECTION,
        Channel("branch_displacement", "m", "internal displacement of the lateral Maxwell branch"),
        DEFLECTION_X,
        BRANCH_X,
    )
    inputs = (SLIP_ANGLE, SLIP_RATIO)
    outputs = (LATERAL_FORCE, LONGITUDINAL_FORCE)
    # the slip is normalised by the curves
    conditions = tuple(c for c in ROLLING_CONDITIONS if c.name != "slip_normalisation")
    typical = MappingProxyType({**TYPICAL_ROLLING, **TYPICAL_BRAKING})
    branches = (
        *MaxwellTyre.branches,
        MaxwellBranch("c_Mx", "d_Mx", parallel=("c_x", "d_x"), part="longitudinal carcass"),
    )
    default = True

    def equations(self, s: Symbols) -> Equations:
        """Deflection and branch of either direction."""
        y = s.quantity("deflection", s.lateral_deflection)
        x = s.quantity("longitudinal_deflection", s.longitudinal_deflection)
        stretch_y, stretch_x = y - s.branch_displacement, x - s.branch_displacement_x
        elastic_y = elastic_force(s, y, s.quantity("maxwell_force", s.c_M * stretch_y))
        elastic_x = elastic_force(s, x, s.quantity("longitudinal_maxwell_force", s.c_Mx * stretch_x), _X)
        in_x, in_y, slope = combined_slip(s, _X.curve(s), LATERAL.curve(s))
        rate_y, force_y = contact_motion(s, elastic_y, slope, *in_y)
        rate_x, force_x = contact_motion(s, elastic_x, slope, *in_x, _X)
        rest_y, rest_x = resting_deflection(s), resting_deflection(s, _X)
        return Equations(
            outputs={"lateral_force": force_y, "longitudinal_force": force_x},
            derivatives={
                "lateral_deflection": rate_y,
                "branch_displacement": s.c_M / s.d_M * stretch_y,
                "longitudinal_deflection": rate_x,
                "branch_displacement_x": s.c_Mx / s.d_Mx * stretch_x,
            },
            initial={
                "lateral_deflection": rest_y,
                "branch_displacement": rest_y,
                "longitudinal_deflection": rest_x,
                "branch_displacement_x": rest_x,
            },
        )
