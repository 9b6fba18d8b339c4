"""True speed other than its label."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class Speed(Effect):
    """Speed times 1 + e.

    Fingerprint: odd harmonics; the lag of the carcass scales with 1/v, the steady state does not.
    """

    name = "speed"
    title = "speed error"
    on = ("longitudinal_velocity",)
    parameters = (Parameter("e_v", "1", -0.3, 0.3, 0.03, description="relative error of the speed", neutral=0.0),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """True speed."""
        return Applied((1 + s.e_v) * value)
