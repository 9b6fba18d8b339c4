"""Damper with Bouc–Wen hysteresis and rate-strengthening friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mofit.library.damper import DAMPER_INPUTS, DAMPER_OUTPUTS, OFFSET
from mofit.model import Channel, Condition, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

# Gauss-Legendre rule over the averaging window, in units of its length; three nodes do (five: 0.1 % of the force less)
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
NODES, WEIGHTS = _ROOTS / 2, _WEIGHTS / 2


class BoucWenDamper(Model):
    r"""Friction damper: a Bouc–Wen element, friction that grows with the logarithm of speed, and a soft spring.

    .. math::
        F &= c (1 + q x) x + F_y z + F_r \operatorname{arsinh}(\dot x / v_s) + F_0 \\
        \delta \dot z &= \dot x - \tfrac12 \left(|\dot x| z + \dot x |z|\right)

    Displacement :math:`x` [m] in (its rate by a smoothing spline), force [N] out; positive together. The hysteretic
    variable :math:`-1 \le z \le 1` is 0 at the start. The element yields at :math:`F_y` over the length
    :math:`\delta`; its stiffness before the yield is :math:`F_y / \delta`, on reversal too.

    Notes
    -----
    Wen, "Method for random vibration of hysteretic systems", J. Eng. Mech. Div. 102 (1976), in the normalised form
    :math:`A = n = 1`, :math:`\beta = \gamma = 1/2`: the exponent and the shape are held because sinusoidal strokes do
    not identify them. The friction is Eyring's law of thermally activated flow (J. Chem. Phys. 4, 1936): viscous,
    :math:`F_r \dot x / v_s`, below :math:`v_s`; logarithmic above.

    A record that went through a centred moving average (condition ``averaging_time`` :math:`W`; 0: none) shows
    friction smeared around every reversal. The model averages its own friction alike:

    .. math::
        \langle f(\dot x, z) \rangle = \sum_k w_k \, f(\dot x + \tau_k \ddot x, z_k), \qquad
        \tau_k = W \xi_k, \quad \ddot x \approx (\dot x - u) / T, \quad T \dot u = \dot x - u, \quad T = W / 10

    with Gauss-Legendre nodes :math:`\xi_k \in [-\frac12, \frac12]` and one :math:`z_k` per node, driven by the speed
    there. The spring is left as it is: averaged displacement in, averaged force out.
    """

    name = "bouc_wen_damper"
    title = "Bouc–Wen damper"
    parameters = (
        Parameter("c", "N/m", 0.0, 1e4, 500.0, description="stiffness at small stroke"),
        Parameter("q", "1/m", -40.0, 40.0, 0.0, description="asymmetry of the stiffness"),
        Parameter("F_y", "N", 1.0, 2e3, 100.0, "log", "yield force of the hysteresis"),
        Parameter("delta", "m", 2e-5, 1e-2, 3e-4, "log", "yield length of the hysteresis"),
        Parameter("F_r", "N", 1.0, 2e3, 100.0, "log", "friction per factor e of speed"),
        Parameter("v_s", "m/s", 1e-4, 1e-1, 3e-3, "log", "speed above which friction is logarithmic"),
        OFFSET,
    )
    states = (
        *(Channel(f"hysteresis_{k}", "1", f"share of the yield force at node {k}, z") for k in range(len(NODES))),
        Channel("lagging_velocity", "m/s", "velocity a little earlier, u"),
    )
    inputs = DAMPER_INPUTS
    outputs = DAMPER_OUTPUTS
    conditions = (Condition("averaging_time", "s", 0.0, "length of the moving average that the record went through"),)
    baseline = "kelvin_voigt_damper"

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
        rates = {
            f"hysteresis_{k}": (speed - (ca.fabs(speed) * z[k] + speed * ca.fabs(z[k])) / 2) / s.delta
            for k, speed in enumerate(speeds)
        }
        return Equations(
            outputs={"force": force + s.F_0},
            rates={**rates, "lagging_velocity": acceleration},
            initial={"lagging_velocity": v},
        )
