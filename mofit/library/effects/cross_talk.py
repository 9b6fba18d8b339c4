"""The vertical load leaks into the lateral channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.model import Applied, Condition, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class CrossTalk(Effect):
    r"""Force plus :math:`\chi F_z`: tilted or coupled force transducer.

    At one load it is a force offset, hence taken into account only when asked for. Fingerprint: mean value,
    proportional to the load.
    """

    name = "cross_talk"
    title = "cross-talk of the load"
    on = ("lateral_force",)
    parameters = (Parameter("chi_z", "1", -0.1, 0.1, 0.005, description="cross-talk of the load", neutral=0.0),)
    conditions = (Condition("vertical_force", "N", None, "vertical load"),)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force as the channel shows it."""
        return Applied(value + s.chi_z * s.vertical_force)
