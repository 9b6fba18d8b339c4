"""Lateral tyre force and self-aligning torque: the pneumatic trail of TMeasy behind the Maxwell tyre."""

from __future__ import annotations

import casadi as ca

from mofit.models.library.steady_state import LATERAL_FORCE
from mofit.models.library.tyres import MaxwellTyre
from mofit.models.model import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter

# the trail at large slip is small, and its end informs little else: a fixed ratio, typical of car tyres
TRAIL_END = 1.75
"""s_E / s_0"""


def pneumatic_trail(slip: ca.SX, n_0: ca.SX, s_0: ca.SX) -> ca.SX:
    r"""Distance n [m] of the lateral force behind the centre of contact.

    With :math:`\sigma = |s| / s_0`, :math:`\sigma_E = s_E / s_0` and :math:`w = s_0 / s_E`

    .. math::
        n / n_0 = \begin{cases}
            (1 - w) (1 - \sigma) + w \, \bigl(1 - (3 - 2 \sigma) \sigma^2\bigr)       & \sigma \le 1 \\
            -(1 - w) (\sigma - 1) \left(\frac{\sigma_E - \sigma}{\sigma_E - 1}\right)^2 & 1 < \sigma < \sigma_E \\
            0                                                                          & \sigma \ge \sigma_E
        \end{cases}

    It is :math:`n_0` without slip, 0 at :math:`s_0`, then a little negative, and its slope is continuous.
    :math:`s_E = 1.75 s_0` is a fixed ratio.

    References
    ----------
    Rill, "Road Vehicle Dynamics", 2nd ed. (2020), section 3.3 (self-aligning torque); Hirschberg, Rill & Weinfurter,
    "Tire model TMeasy", Vehicle System Dynamics 45 (2007), 101-119.
    """
    weight, sigma = 1 / TRAIL_END, ca.fabs(slip) / s_0
    falling = (1 - weight) * (1 - sigma) + weight * (1 - (3 - 2 * sigma) * sigma**2)
    left = ca.fmax(TRAIL_END - sigma, 0) / (TRAIL_END - 1)
    return n_0 * ca.if_else(sigma <= 1, falling, -(1 - weight) * (sigma - 1) * left**2)


class MaxwellTyreAligning(Model):
    r"""The Maxwell tyre with its self-aligning torque :math:`M_z = -n(s_c) \, F_y`.

    :math:`n` is the trail of `pneumatic_trail` at the slip of the contact patch, :math:`s_c = s - \dot y / v^*`; at
    rest that is the slip itself. A positive slip angle gives a positive force and a negative torque [N m], which turns
    the wheel back. The lateral force is that of `MaxwellTyre`. With turning of the contact patch see
    `mofit.models.library.turn_slip.MaxwellTyreTurning`.
    """

    name = "maxwell_tyre_aligning"
    title = "Maxwell tyre with self-aligning torque"
    parameters = (
        *MaxwellTyre.parameters,
        Parameter("n_0", "m", 1e-3, 0.15, 0.03, "log", "pneumatic trail without slip"),
        Parameter("s_0", "1", 0.03, 1.0, 0.2, "log", "slip at which the pneumatic trail is zero"),
    )
    states, inputs, conditions = MaxwellTyre.states, MaxwellTyre.inputs, MaxwellTyre.conditions
    outputs = (LATERAL_FORCE, Channel("self_aligning_torque", "N m", "self-aligning torque"))
    typical, excitations, stages = MaxwellTyre.typical, MaxwellTyre.excitations, MaxwellTyre.stages
    branches = MaxwellTyre.branches
    default = True

    def equations(self, s: Symbols) -> Equations:
        """The Maxwell tyre, and the torque of its force."""
        found = MaxwellTyre().equations(s)
        force = found.outputs["lateral_force"]
        slip = force / s.quantities["slip_stiffness"]
        trail = s.quantity("pneumatic_trail", pneumatic_trail(slip, s.n_0, s.s_0))
        return Equations(
            outputs={**found.outputs, "self_aligning_torque": -trail * force},
            derivatives=found.derivatives,
            initial=found.initial,
        )
