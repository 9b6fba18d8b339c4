"""Damper with Bouc–Wen hysteresis and rate-strengthening friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.library.damper import DAMPER_INPUTS, DAMPER_OUTPUTS, OFFSET
from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class BoucWenDamper(Model):
    r"""Friction damper: a Bouc–Wen element, friction that grows with the logarithm of speed, and a soft spring.

    .. math::
        F &= c (1 + q x) x + F_y z + F_r \operatorname{arsinh}(\dot x / v_s) + F_0 \\
        \delta \dot z &= \dot x - \tfrac12 \left(|\dot x| z + \dot x |z|\right)

    Displacement :math:`x` [m] in (its rate by a smoothing spline), force [N] out; positive together. State: the
    hysteretic variable :math:`-1 \le z \le 1`, 0 at the start. The element yields at :math:`F_y` over the length
    :math:`\delta`; its stiffness before the yield is :math:`F_y / \delta`, on reversal too.

    Notes
    -----
    Wen, "Method for random vibration of hysteretic systems", J. Eng. Mech. Div. 102 (1976), in the normalised form
    :math:`A = n = 1`, :math:`\beta = \gamma = 1/2`: the exponent and the shape are held because sinusoidal strokes do
    not identify them. The friction is Eyring's law of thermally activated flow (J. Chem. Phys. 4, 1936): viscous,
    :math:`F_r \dot x / v_s`, below :math:`v_s`; logarithmic above.
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
    states = (Channel("hysteresis", "1", "share of the yield force, z"),)
    inputs = DAMPER_INPUTS
    outputs = DAMPER_OUTPUTS
    baseline = "kelvin_voigt_damper"

    def equations(self, s: Symbols) -> Equations:
        """One state: the hysteretic variable."""
        x, v, z = s.quantity("deflection", s.displacement), s.velocity, s.hysteresis
        spring = s.quantity("spring_force", s.c * (1 + s.q * x) * x)
        friction = s.quantity("damper_force", s.F_r * ca.asinh(v / s.v_s))
        hysteresis = s.quantity("hysteretic_force", s.F_y * z)
        return Equations(
            outputs={"force": spring + friction + hysteresis + s.F_0},
            rates={"hysteresis": (v - (ca.fabs(v) * z + v * ca.fabs(z)) / 2) / s.delta},
        )
