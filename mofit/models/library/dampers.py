"""Dampers driven by a displacement: Kelvin–Voigt, Maxwell and Bouc–Wen."""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca
import numpy as np

from mofit.models.model import Channel, Condition, Equations, MaxwellBranch, Model, Symbols
from mofit.parameters import Parameter, powers

#: how parameters grow with force, stroke and speed
FORCE, STROKE, SPEED = powers(force=1), powers(displacement=1), powers(velocity=1)
PER_STROKE, PER_SPEED = powers(force=1, displacement=-1), powers(force=1, velocity=-1)

STIFFNESS = Parameter("c", "N/m", 0.0, 1e6, 1e4, description="stiffness at small stroke", scales=PER_STROKE)
# not relative to c as the tyre's p_y is: where c is 0 a relative one means nothing, and the posterior has a ridge
PROGRESSION = Parameter(
    "p", "N/m^2", -5e7, 5e7, 0.0,
    description="change of stiffness with stroke", scales=powers(force=1, displacement=-2),
)  # fmt: skip
OFFSET = Parameter(
    "F_0", "N", -2e3, 2e3, 0.0, description="constant force (gas pressure, transducer offset)", scales=FORCE
)

# Gauss-Legendre rule over the averaging window, in units of its length; three nodes do (five: 0.1 % of the force less)
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
NODES, WEIGHTS = _ROOTS / 2, _WEIGHTS / 2


#: ranges of displacement, velocity and force for which the ranges of dampers are written, those of effects too
TYPICAL_STROKE = MappingProxyType({"displacement": 0.02, "velocity": 0.2, "force": 2e3})


class Damper(Model):
    """What the damper models share: displacement [m] in (its rate by a smoothing spline), force [N] out."""

    inputs = (
        Channel("displacement", "m", "stroke; positive in extension or compression, as the force"),
        Channel("velocity", "m/s", "rate of the stroke", derivative_of="displacement"),
    )
    outputs = (Channel("force", "N", "force on the moved end, positive with the displacement"),)
    typical = TYPICAL_STROKE


def parallel_force(s: Symbols, x: ca.SX) -> ca.SX:
    r"""Spring and damper in parallel and an offset: :math:`(c + p |x|) x + d \dot x + F_0` [N].

    Announces ``spring_force`` and ``damper_force``.
    """
    spring = s.quantity("spring_force", (s.c + s.p * ca.fabs(x)) * x)
    return spring + s.quantity("damper_force", s.d * s.velocity) + s.F_0


class KelvinVoigtDamper(Damper):
    r"""Spring and damper in parallel, :math:`F = (c + p |x|) x + d \dot x + F_0`."""

    name = "kelvin_voigt_damper"
    title = "Kelvin–Voigt damper"
    parameters = (
        STIFFNESS,
        PROGRESSION,
        Parameter("d", "N s/m", 1.0, 1e6, 1e3, "log", "damping", scales=PER_SPEED),
        OFFSET,
    )

    def equations(self, s: Symbols) -> Equations:
        """No state: the force follows displacement and velocity at once."""
        return Equations(outputs={"force": parallel_force(s, s.quantity("deflection", s.displacement))})


class MaxwellDamper(Damper):
    r"""Kelvin–Voigt damper with one Maxwell branch in parallel.

    .. math::
        F = (c + p |x|) x + d \dot x + c_M (x - x_M) + F_0, \qquad d_M \dot x_M = c_M (x - x_M)

    State: internal displacement :math:`x_M` [m] of the branch, relaxed at the start. The law of `MaxwellTyre` with a
    given deflection.
    """

    name = "maxwell_damper"
    title = "Maxwell damper"
    parameters = (
        STIFFNESS,
        PROGRESSION,
        Parameter("d", "N s/m", 0.0, 1e5, 1e3, description="damping in parallel", scales=PER_SPEED),
        Parameter("c_M", "N/m", 1e2, 1e7, 1e5, "log", "stiffness of the Maxwell branch", scales=PER_STROKE),
        Parameter("d_M", "N s/m", 1.0, 1e6, 1e3, "log", "damping of the Maxwell branch", scales=PER_SPEED),
        OFFSET,
    )
    states = (Channel("branch_displacement", "m", "internal displacement of the Maxwell branch"),)
    baseline = KelvinVoigtDamper.name
    branches = (MaxwellBranch("c_M", "d_M", parallel=("c", "d"), part="damper"),)
    default = True

    def equations(self, s: Symbols) -> Equations:
        """One state: the branch."""
        x = s.quantity("deflection", s.displacement)
        stretch = x - s.branch_displacement
        branch = s.quantity("maxwell_force", s.c_M * stretch)
        return Equations(
            outputs={"force": parallel_force(s, x) + branch},
            derivatives={"branch_displacement": s.c_M / s.d_M * stretch},
            initial={"branch_displacement": x},
        )


class BoucWenDamper(Damper):
    r"""Friction damper: a Bouc–Wen element, friction that grows with the logarithm of speed, and a soft spring.

    .. math::
        F &= c (1 + q x) x + F_y z + F_r \operatorname{arsinh}(\dot x / v_s) + F_0 \\
        \delta \dot z &= \dot x - \tfrac12 \left(|\dot x| z + \dot x |z|\right)

    The hysteretic variable :math:`-1 \le z \le 1` is 0 at the start. The element yields at :math:`F_y` over the
    length :math:`\delta`; its stiffness before the yield is :math:`F_y / \delta`, on reversal too.

    Notes
    -----
    Wen, "Method for random vibration of hysteretic systems", J. Eng. Mech. Div. 102 (1976), in the normalised form
    :math:`A = n = 1`, :math:`\beta = \gamma = 1/2`: the exponent and the shape are fixed because sinusoidal strokes do
    not identify them. The friction is Eyring's law of thermally activated flow (J. Chem. Phys. 4, 1936): viscous,
    :math:`F_r \dot x / v_s`, below :math:`v_s`; logarithmic above.

    A record that went through a centred moving average (condition ``averaging_time`` :math:`W`; 0: none) shows
    friction smeared around every reversal. The model averages its own friction in the same way:

    .. math::
        \langle f(\dot x, z) \rangle = \sum_k w_k \, f(\dot x + \tau_k \ddot x, z_k), \qquad
        \tau_k = W \xi_k, \quad \ddot x \approx (\dot x - u) / T, \quad T \dot u = \dot x - u, \quad T = W / 10

    with Gauss-Legendre nodes :math:`\xi_k \in [-\frac12, \frac12]` and one :math:`z_k` per node, driven by the speed
    there. The spring is left as it is: averaged displacement in, averaged force out.
    """

    name = "bouc_wen_damper"
    title = "Bouc–Wen damper"
    parameters = (
        STIFFNESS,
        Parameter(
            "q", "1/m", -100.0, 100.0, 0.0, description="asymmetry of the stiffness", scales=powers(displacement=-1)
        ),
        Parameter("F_y", "N", 1.0, 2e3, 100.0, "log", "yield force of the hysteresis", scales=FORCE),
        Parameter("delta", "m", 2e-5, 1e-2, 3e-4, "log", "yield length of the hysteresis", scales=STROKE),
        Parameter("F_r", "N", 1.0, 2e3, 100.0, "log", "friction per factor e of speed", scales=FORCE),
        Parameter("v_s", "m/s", 1e-4, 1e-1, 3e-3, "log", "speed above which friction is logarithmic", scales=SPEED),
        OFFSET,
    )
    states = (
        *(Channel(f"hysteresis_{k}", "1", f"share of the yield force at node {k}, z") for k in range(len(NODES))),
        Channel("lagging_velocity", "m/s", "velocity a little earlier, u"),
    )
    conditions = (Condition("averaging_time", "s", 0.0, "length of the moving average that the record went through"),)
    baseline = KelvinVoigtDamper.name

    def equations(self, s: Symbols) -> Equations:
        """A hysteretic variable per node, and the velocity that gives the acceleration."""
        x, v, window = s.quantity("deflection", s.displacement), s.velocity, s.averaging_time
        acceleration = (v - s.lagging_velocity) / ca.if_else(window > 0, window / 10, 1)
        speeds = [v + window * node * acceleration for node in NODES]
        z = [getattr(s, f"hysteresis_{k}") for k in range(len(NODES))]
        friction = sum(weight * ca.asinh(speed / s.v_s) for weight, speed in zip(WEIGHTS, speeds, strict=True))
        hysteresis = sum(weight * share for weight, share in zip(WEIGHTS, z, strict=True))
        force = s.quantity("spring_force", s.c * (1 + s.q * x) * x)
        force += s.quantity("damper_force", s.F_r * friction)
        force += s.quantity("hysteretic_force", s.F_y * hysteresis)
        derivatives = {
            f"hysteresis_{k}": (speed - (ca.fabs(speed) * z[k] + speed * ca.fabs(z[k])) / 2) / s.delta
            for k, speed in enumerate(speeds)
        }
        return Equations(
            outputs={"force": force + s.F_0},
            derivatives={**derivatives, "lagging_velocity": acceleration},
            initial={"lagging_velocity": v},
        )
