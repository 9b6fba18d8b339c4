"""The lateral force changes the vertical load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.kelvin_voigt_tyre import contact_force
from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class LoadCoupling(Effect):
    r"""Vertical load :math:`F_z (1 + \kappa F)`, and the contact patch's force with it: the loading arm leans.

    Fingerprint: mean value and even harmonics.
    """

    name = "load_coupling"
    title = "lateral force on the load"
    # the force itself of a settled tyre
    on = ("slip_stiffness", "steady_state_force")
    needs = ("lateral_slip", "transport_velocity")
    # half a per cent per kilonewton
    parameters = (
        Parameter("kappa_z", "1/N", -1e-4, 1e-4, 5e-6, description="relative change of load per force", neutral=0.0),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slope of the contact patch, or its force, under the true load."""
        if "d_y" not in s:
            return Applied(value * (1 + s.kappa_z * value))
        force = contact_force(s, value, s.quantities["lateral_slip"], s.quantities["transport_velocity"])
        return Applied(value * (1 + s.kappa_z * force))
