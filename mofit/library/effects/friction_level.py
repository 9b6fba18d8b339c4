"""Another level of friction than in the steady-state tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class FrictionLevel(Effect):
    """Maximum force times 1 + e: surface, temperature or wear differ from those of the step tests.

    Fingerprint: odd harmonics, growing with slip.
    """

    name = "friction_level"
    title = "error of the friction level"
    on = ("F_M",)
    parameters = (
        Parameter("e_mu", "1", -0.5, 0.5, 0.08, description="relative error of the maximum force", neutral=0.0),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Maximum force in the tests at hand."""
        return Applied((1 + s.e_mu) * value)
