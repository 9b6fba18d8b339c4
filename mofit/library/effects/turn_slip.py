"""The contact patch moves sideways while the wheel is steered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.washout import SAMPLE_INTERVAL, Washout, base_time, derivative, washout_states
from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class TurnSlip(Effect):
    r"""Slip angle :math:`\alpha + l \dot\alpha / v`: steering axis a length :math:`l` off the contact, turn slip.

    With negative :math:`l` it is a contact-patch lag to first order, hence taken into account only when asked for.
    Fingerprint: odd harmonics, phase growing with f and 1/v.
    """

    name = "turn_slip"
    title = "turn slip"
    on = ("slip_angle",)
    needs = ("longitudinal_velocity", "fictitious_velocity")
    parameters = (Parameter("l_t", "m", -0.2, 0.2, 0.02, description="lever of the turning", neutral=0.0),)
    states = washout_states(name, "rad")
    conditions = (SAMPLE_INTERVAL,)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle of the contact patch."""
        chain = Washout(s, self.states, value, base_time(s))
        speed = s.longitudinal_velocity + s.fictitious_velocity
        return chain.applied(value + s.l_t / speed * derivative(chain))
