"""Lags of the measuring chain."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Effect
from mofit.models.filters import Washout, delay_time, delayed, lagged, washout_states, washout_time
from mofit.models.model import SAMPLE_INTERVAL, TARGET_UNIT, Applied, Symbols
from mofit.parameters import Parameter, powers

#: how times grow with the data
DURATION = powers(time=1)


class Delay(Effect):
    r"""Output :math:`F(t - \tau)`: transmission, anti-alias filter, channels sampled one after another.

    Negative: the input's channel lags behind. Fingerprint: phase proportional to f, whatever the speed.
    """

    name = "delay"
    title = "delay of the measurement"
    family = "lag or delay"
    on = ("output",)
    parameters = (
        Parameter("tau_d", "s", -0.02, 0.05, 0.004, description="delay of the output", neutral=0.0, scales=DURATION),
    )
    states = washout_states(name, TARGET_UNIT)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output, delayed."""
        chain = Washout(s, self.states, value, delay_time(s, s.tau_d))
        return chain.applied(delayed(chain, s.tau_d))


class SensorLowpass(Effect):
    r"""Output behind a first-order low-pass, :math:`T \dot F' = F - F'`: amplifier, filter, compliance of the hub.

    Fingerprint: a delay :math:`T`, and a loss of gain with f².
    """

    name = "sensor_lowpass"
    title = "low-pass of the sensor"
    family = "lag or delay"
    on = ("output",)
    parameters = (
        Parameter("T_f", "s", 0.0, 0.1, 0.005, description="time constant of the filter", neutral=0.0, scales=DURATION),
    )
    states = washout_states(name, TARGET_UNIT)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output behind the filter."""
        chain = Washout(s, self.states, value, s.T_f + washout_time(s))
        return chain.applied(lagged(chain, s.T_f))


class LoadDependentLag(Effect):
    r"""Output behind a first-order lag that grows with its load, :math:`T (1 + |F| / F_T) \dot F' = F - F'`.

    A hydraulic line, a soft hub, a belt. Fingerprint: odd harmonics in quadrature beside those of a low-pass.
    """

    name = "load_dependent_lag"
    title = "lag that grows with the load"
    family = "lag or delay"
    on = ("output",)
    parameters = (
        Parameter(
            "T_l", "s", 0.0, 0.1, 0.005, description="time constant without load", neutral=0.0, scales=DURATION
        ),
        Parameter(
            "F_T", TARGET_UNIT, 10.0, 1e4, 300.0, "log", "output at which the time constant has doubled",
            grid=(50.0, 500.0), scales=powers(output=1),
        ),
    )  # fmt: skip
    states = washout_states(name, TARGET_UNIT)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output behind the lag."""
        lag = s.T_l * (1 + ca.fabs(value) / s.F_T)
        chain = Washout(s, self.states, value, lag + washout_time(s))
        return chain.applied(lagged(chain, lag))
