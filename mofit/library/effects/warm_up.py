"""Gain that settles within each run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class WarmUp(Effect):
    r"""Output times :math:`1 + w e^{-t / \tau}`: the specimen warms in every run anew.

    Fingerprint: skirts around the excitation's lines, most in short tests.
    """

    name = "warm_up"
    title = "warm-up within a run"
    on = ("output",)
    parameters = (
        Parameter("w_t", "1", -0.5, 0.5, 0.02, description="relative excess of gain at the first sample", neutral=0.0),
        Parameter("tau_t", "s", 0.1, 1e3, 3.0, "log", "time in which it fades", grid=(1.0, 4.0, 15.0)),
    )
    inputs = (Channel("time", "s", "time since the first sample"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output with the gain of its time."""
        return Applied(value * (1 + s.w_t * ca.exp(-s.time / s.tau_t)))
