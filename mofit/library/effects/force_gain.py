"""Gain error of the force transducer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class ForceGain(Effect):
    """Force times 1 + g. Fingerprint: all harmonics alike."""

    name = "force_gain"
    title = "force gain"
    on = ("lateral_force", "force")
    parameters = (Parameter("g_F", "1", -0.2, 0.2, 0.02, description="gain error of the force", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with its gain error."""
        return Applied((1 + s.g_F) * value)
