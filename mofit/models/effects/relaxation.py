"""Relaxation of models that name no spring: cells, tanks, heated bodies."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Effect
from mofit.models.model import TARGET_UNIT, Applied, Channel, Symbols
from mofit.parameters import Parameter, powers


class Relaxation(Effect):
    r"""Output :math:`F - \kappa (F - F_1)` with :math:`\tau \dot F_1 = F - F_1`: part of the response comes late.

    Positive: creep, as the polarisation of a cell behind its series resistance (an RC branch); negative: the response
    relaxes. The steady gain stays. :math:`\kappa = 1` is a low-pass of the sensor. Where a model names a spring, the
    branches beside it say the same (`mofit.models.effects.viscoelastic`).
    """

    name = "relaxation"
    title = "relaxation (one branch)"
    family = "relaxation"
    on = ("output",)
    unless = ("spring_force", "carcass_force")
    parameters = (
        Parameter("kappa", "1", -10.0, 1.0, 0.1, description="share of the response that comes late", neutral=0.0),
        Parameter(
            "tau_r", "s", 1e-3, 100.0, 0.5, "log", "relaxation time", grid=(0.05, 0.25, 1.0, 5.0),
            scales=powers(time=1),
        ),
    )  # fmt: skip
    states = (Channel("relaxed_response", TARGET_UNIT, "response of the branch"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output without the part that is still to come."""
        (state,) = (channel.name for channel in self.states)
        missing = value - getattr(s, state)
        return Applied(value - s.kappa * missing, {state: missing / s.tau_r}, initial={state: value})
