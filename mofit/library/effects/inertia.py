"""Mass between the deflecting part and the force transducer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.washout import SAMPLE_INTERVAL, Washout, base_time, derivative, washout_states
from mofit.model import Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


#: Share of the sampling interval for the washout: a tyre's acceleration jumps where the slip changes its sign, and a
#: longer one smears the jump over the next sample.
_SHARE = 0.1


class Inertia(Effect):
    r"""Force minus :math:`m \ddot y` (tyres: belt and tread move with the deflection), or plus (dampers: moved end).

    Fingerprint: odd harmonics, growing with f², in phase with the deflection.
    """

    name = "inertia"
    title = "inertia"
    on = ("lateral_force", "damper_force")
    needs = ("deflection_rate or velocity",)
    parameters = (Parameter("m_b", "kg", 0.0, 100.0, 5.0, description="mass that is accelerated", neutral=0.0),)
    states = washout_states(name, "m/s")
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with that of the mass."""
        rate = s.quantities.get("deflection_rate")
        chain = Washout(s, self.states, s.velocity if rate is None else rate, base_time(s, _SHARE))
        return chain.applied(value + (1 if rate is None else -1) * s.m_b * derivative(chain))
