"""Gain that drifts over the campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Channel, Condition, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class Drift(Effect):
    r"""Output times :math:`1 + k (t_0 + t)`, with the test's start :math:`t_0` since the campaign began.

    Wear, temperature, a drifting amplifier. Fingerprint: follows the run order, and only seemingly the frequency.
    """

    name = "drift"
    title = "drift over the campaign"
    on = ("output",)
    # -4 % in a quarter of an hour
    parameters = (
        Parameter("k_t", "1/s", -1e-3, 1e-3, -4.5e-5, description="relative change of gain per time", neutral=0.0),
    )
    inputs = (Channel("time", "s", "time since the first sample"),)
    conditions = (Condition("start_time", "s", None, "time since the campaign began"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output with the gain of its time."""
        return Applied(value * (1 + s.k_t * (s.start_time + s.time)))
