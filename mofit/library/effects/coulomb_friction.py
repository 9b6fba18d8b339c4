"""Dry friction without a build-up length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class CoulombFriction(Effect):
    r"""A force :math:`F_C \tanh(\dot x / v_C)` [N] beside the damper.

    Dry friction (Dahl) with a short build-up length is the same but for the reversals, hence taken into account only
    when asked for. Fingerprint: odd harmonics, whatever amplitude and frequency.
    """

    name = "coulomb_friction"
    title = "Coulomb friction"
    on = ("damper_force",)
    needs = ("velocity",)
    parameters = (
        Parameter("F_C", "N", 0.0, 1e3, 30.0, description="friction force", neutral=0.0),
        Parameter("v_C", "m/s", 1e-5, 1.0, 5e-3, "log", "speed at which it is there", grid=(5e-4, 5e-3, 5e-2)),
    )
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Damper force with the friction."""
        return Applied(value + s.F_C * ca.tanh(s.velocity / s.v_C))
