"""One more Maxwell branch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class SecondBranch(Effect):
    r"""Spring force plus :math:`c_2 (y - y_2)` [N] with :math:`\tau_2 \dot y_2 = y - y_2`.

    Fingerprint: odd harmonics, loss largest at :math:`\omega = 1 / \tau_2`.
    """

    name = "second_branch"
    title = "second Maxwell branch"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter("c_2", "N/m", 0.0, 1e5, 1.2e4, description="stiffness of the branch", neutral=0.0),
        Parameter("tau_2", "s", 1e-3, 10.0, 0.05, "log", "relaxation time of the branch", grid=(0.01, 0.05, 0.25, 1.0)),
    )
    states = (Channel("second_branch_displacement", "m", "internal displacement of the branch"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the branch beside it, relaxed at the start."""
        y = s.quantities["deflection"]
        stretch = y - s.second_branch_displacement
        return Applied(
            value + s.c_2 * stretch,
            rates={"second_branch_displacement": stretch / s.tau_2},
            initial={"second_branch_displacement": y},
        )
