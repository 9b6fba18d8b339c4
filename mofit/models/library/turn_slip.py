"""A tyre whose contact patch turns while it rolls: side force and torque of turn slip beside the slip angle."""

from __future__ import annotations

from types import MappingProxyType

from mofit.models.library.aligning_torque import MaxwellTyreAligning
from mofit.models.library.steady_state import LOAD
from mofit.models.model import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter

TURN_SLIP = Channel("turn_slip", "1/m", "curvature of the path with the opposite sign")


class MaxwellTyreTurning(Model):
    r"""The Maxwell tyre with self-aligning torque, on a curved path or steered about its vertical axis.

    Turn slip :math:`\varphi = -\dot\psi / v` [1/m] is the yaw rate of the wheel over its speed, about the curvature of
    its path. It adds to the sliding velocity of the contact patch, as a slip angle :math:`l_\varphi \varphi` would, and
    turns the patch itself:

    .. math::
        s = v \, (\sin\alpha + l_\varphi \varphi) / v^*, \qquad M_z = -n(s_c) \, F_y + m_\varphi \varphi

    The rest is `MaxwellTyreAligning`. Positive turn slip (a right turn, y to the left) has a positive force. For a
    brush of half length a, half width b and little slip

    .. math::
        l_\varphi = n_0 = \tfrac a3, \qquad m_\varphi = n_0 \, l_\varphi \, dF_0 + \tfrac{b^2}3 C_{F\kappa}

    with the longitudinal slip stiffness :math:`C_{F\kappa}`: along its middle line the torque of the force vanishes. A
    stretched string has :math:`l_\varphi` equal to its trail without slip, too.

    Notes
    -----
    Both terms are linear: little turn slip beside a contact patch that adheres. A patch that slides all over (a curve
    of a few metres, parking) has less torque. Turn slip passes the same carcass as the slip angle; the lag of the
    contact line, which is bent over the length of the patch, is left out. Camber is no part of it.

    References
    ----------
    Pacejka, "Tire and Vehicle Dynamics", 3rd ed. (2012), section 3.2 (brush with turn slip) and chapter 5 (string).
    """

    name = "maxwell_tyre_turning"
    title = "Maxwell tyre with turn slip and self-aligning torque"
    parameters = (
        *MaxwellTyreAligning.parameters,
        Parameter("l_phi", "m", 1e-3, 0.3, 0.03, "log", "side force per turn slip over that per slip angle"),
        Parameter("m_phi", "N m^2", 1.0, 5e3, 150.0, "log", "torque per turn slip, beside the force", scales=LOAD),
    )
    states, outputs = MaxwellTyreAligning.states, MaxwellTyreAligning.outputs
    inputs = (*MaxwellTyreAligning.inputs, TURN_SLIP)
    conditions, excitations = MaxwellTyreAligning.conditions, MaxwellTyreAligning.excitations
    typical = MappingProxyType({**MaxwellTyreAligning.typical, "turn_slip": 0.05})
    stages, branches = MaxwellTyreAligning.stages, MaxwellTyreAligning.branches
    default = True

    def equations(self, s: Symbols) -> Equations:
        """The tyre under slip angle and turn slip, and the torque of the patch."""
        found = MaxwellTyreAligning().equations(s)
        torque = found.outputs["self_aligning_torque"] + s.m_phi * s.turn_slip
        return Equations(
            outputs={**found.outputs, "self_aligning_torque": torque},
            derivatives=found.derivatives,
            initial=found.initial,
        )
