"""Another cornering stiffness than in the steady-state tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class CorneringStiffness(Effect):
    r"""Initial slope :math:`dF_0 (1 + e)`: temperature, wear or load differ from those of the step tests.

    Fingerprint: odd harmonics, all frequencies, most at small slip.
    """

    name = "cornering_stiffness"
    title = "error of the cornering stiffness"
    on = ("dF0",)
    parameters = (
        Parameter(
            "e_alpha", "1", -0.5, 0.5, 0.05, description="relative error of the cornering stiffness", neutral=0.0
        ),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slope in the tests at hand."""
        return Applied((1 + s.e_alpha) * value)
