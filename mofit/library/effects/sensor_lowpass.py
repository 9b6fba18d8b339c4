"""Low-pass filter in the output's measuring chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.library.washout import SAMPLE_INTERVAL, Washout, base_time, lagged, washout_states
from mofit.model import UNIT_OF_TARGET, Applied, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    import casadi as ca

    from mofit.model import Symbols


class SensorLowpass(Effect):
    r"""Output behind a first-order low-pass, :math:`T \dot F' = F - F'`: amplifier, filter, compliance of the hub.

    Fingerprint: a delay :math:`T`, and a loss of gain with f².
    """

    name = "sensor_lowpass"
    title = "low-pass of the sensor"
    on = ("output",)
    parameters = (Parameter("T_f", "s", 0.0, 0.1, 0.005, description="time constant of the filter", neutral=0.0),)
    states = washout_states(name, UNIT_OF_TARGET)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output behind the filter."""
        chain = Washout(s, self.states, value, s.T_f + base_time(s))
        return chain.applied(lagged(chain, s.T_f))
