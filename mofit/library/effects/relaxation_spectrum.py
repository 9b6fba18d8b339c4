"""A broad spectrum of relaxation times, as rubber has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mofit.model import Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols

BRANCHES = 8


class RelaxationSpectrum(Effect):
    r"""Spring force plus eight Maxwell branches of equal stiffness, their relaxation times evenly spaced in log time.

    .. math::
        \sum_{i=1}^{8} \frac{c_R}{8} (y - y_i), \quad \tau_i \dot y_i = y - y_i, \quad
        \tau_i = \tau_R \, 10^{w_R (\frac{i - 1}{7} - \frac12)}

    A box spectrum (Ferry, "Viscoelastic properties of polymers", 1980): over :math:`w_R` decades the storage
    modulus grows with log frequency and the loss is nearly constant.
    """

    name = "relaxation_spectrum"
    title = "relaxation spectrum"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    # few campaigns tell it from a springpot or a second branch
    candidate = False
    parameters = (
        Parameter("c_R", "N/m", 0.0, 2e5, 2e4, description="stiffness of all branches together", neutral=0.0),
        Parameter("tau_R", "s", 1e-3, 10.0, 0.1, "log", "central relaxation time", grid=(0.015, 0.1)),
        Parameter("w_R", "1", 0.5, 6.0, 3.0, description="width in decades", grid=(2.0, 4.0)),
    )
    states = tuple(Channel(f"relaxation_{i}", "m", f"internal displacement of branch {i}") for i in range(BRANCHES))

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Spring force with the branches beside it, relaxed at the start."""
        y = s.quantities["deflection"]
        stretch = {state.name: y - getattr(s, state.name) for state in self.states}
        times = [s.tau_R * 10 ** (s.w_R * place) for place in np.linspace(-0.5, 0.5, BRANCHES)]
        return Applied(
            value + s.c_R / BRANCHES * sum(stretch.values()),
            rates={name: gap / time for (name, gap), time in zip(stretch.items(), times, strict=True)},
            initial=dict.fromkeys(stretch, y),
        )
