"""The force turns the wheel back in its mounting."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.library.kelvin_voigt_tyre import contact_force
from mofit.library.tmeasy import slip_stiffness
from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


#: Rounds in which angle and force of a settled tyre find each other; each takes off nine tenths of what is left.
_ROUNDS = 5


class SteeringCompliance(Effect):
    r"""Slip angle :math:`\alpha - \kappa F`: the steering behind the angle's transducer is not rigid.

    The force depends on the angle in turn, :math:`F(\alpha - \kappa F) \approx F(\alpha) / (1 + \kappa F')` at the
    present deflection, within 0.03 N of the implicit solution at typical size. Fingerprint: odd harmonics, growing
    with load; like less cornering stiffness at one load.
    """

    name = "steering_compliance"
    title = "compliance of the steering"
    on = ("slip_angle",)
    needs = ("dF0",)
    # 0.08 degrees per kilonewton
    parameters = (Parameter("kappa_s", "rad/N", 0.0, 3e-5, 1.4e-6, description="steering compliance", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Angle that the tyre sees."""
        transport = s.longitudinal_velocity * s.slip_normalisation + s.fictitious_velocity
        if "d_y" not in s:
            return Applied(self._settled(s, value, transport))
        slip = s.longitudinal_velocity * ca.sin(value) / transport
        slope = slip_stiffness(s, slip)
        through_damper = transport * s.d_y
        gain = slope * through_damper / (through_damper + slope)
        force = contact_force(s, slope, slip, transport) / (1 + s.kappa_s * gain)
        return Applied(value - s.kappa_s * force)

    def _settled(self, s: Symbols, value: ca.SX, transport: ca.SX) -> ca.SX:
        """Angle of a settled tyre, whose force follows the angle at once."""
        angle = value
        for _ in range(_ROUNDS):
            slip = s.longitudinal_velocity * ca.sin(angle) / transport
            angle = value - s.kappa_s * slip_stiffness(s, slip) * slip
        return angle
