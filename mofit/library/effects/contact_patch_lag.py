"""The contact patch needs a length to follow the slip angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.washout import SAMPLE_INTERVAL, Washout, base_time, lagged, washout_states
from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class ContactPatchLag(Effect):
    r"""Slip angle behind a lag over a travelled length, :math:`\dot\alpha' = (\alpha - \alpha') v / \sigma`.

    Tread elements deflect anew while they pass the patch: :math:`\sigma` is about half its length (Pacejka, "Tire and
    Vehicle Dynamics", section 9.3). Fingerprint: odd harmonics, phase growing with f and with 1/v: a test at another
    speed tells it from a delay.
    """

    name = "contact_patch_lag"
    title = "lag of the contact patch"
    on = ("slip_angle",)
    needs = ("longitudinal_velocity", "fictitious_velocity")
    parameters = (Parameter("sigma_c", "m", 0.0, 0.5, 0.05, description="relaxation length of the patch", neutral=0.0),)
    states = washout_states(name, "rad")
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle behind the lag."""
        lag = s.sigma_c / (s.longitudinal_velocity + s.fictitious_velocity)
        chain = Washout(s, self.states, value, lag + base_time(s))
        return chain.applied(lagged(chain, lag))
