"""Delay of the measured output."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.washout import SAMPLE_INTERVAL, Washout, base_time, delayed, washout_states
from mofit.model import UNIT_OF_TARGET, Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class Delay(Effect):
    r"""Output :math:`F(t - \tau)`: transmission, anti-alias filter, channels sampled one after another.

    Negative: the input's channel lags behind. Fingerprint: phase proportional to f, whatever the speed.
    """

    name = "delay"
    title = "delay of the measurement"
    on = ("output",)
    parameters = (Parameter("tau_d", "s", -0.02, 0.05, 0.004, description="delay of the output", neutral=0.0),)
    states = washout_states(name, UNIT_OF_TARGET)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output, delayed."""
        chain = Washout(s, self.states, value, base_time(s))
        return chain.applied(delayed(chain, s.tau_d))
