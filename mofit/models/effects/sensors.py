"""Measuring chain: gain, offset, cross-talk, delay and low-pass."""

from __future__ import annotations

import casadi as ca

from mofit.models.declarations import SAMPLE_INTERVAL, TARGET_UNIT, Applied, Condition
from mofit.models.effect import Addition, Effect, Scaling
from mofit.models.filters import Washout, delayed, lagged, washout_states, washout_time
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter


class ForceGain(Scaling):
    r"""Force :math:`(1 + g) F`: gain error of the transducer. Fingerprint: all harmonics alike."""

    name = "force_gain"
    title = "force gain"
    on = ("lateral_force", "force")
    parameters = (Parameter("g_F", "1", -0.2, 0.2, 0.02, description="gain error of the force", neutral=0.0),)


class ForceOffset(Addition):
    r"""Force :math:`F + F_{off}`: conicity of a tyre, zero drift of a transducer. Fingerprint: mean value only."""

    name = "force_offset"
    title = "force offset"
    on = ("lateral_force", "force")
    parameters = (Parameter("F_off", "N", -500.0, 500.0, 25.0, description="offset of the force", neutral=0.0),)


class SlipOffset(Addition):
    r"""Slip angle :math:`\alpha + \alpha_0`: toe, ply steer, alignment. Fingerprint: mean value and second harmonic."""

    name = "slip_offset"
    title = "slip-angle offset"
    on = ("slip_angle",)
    parameters = (Parameter("alpha_0", "rad", -0.02, 0.02, 0.0014, description="slip-angle offset", neutral=0.0),)


class CrossTalk(Addition):
    r"""Force :math:`F + \chi F_z`: tilted or coupled force transducer.

    At one load it is a force offset, so a diagnosis tries it only when named. Fingerprint: mean value,
    proportional to the load.
    """

    name = "cross_talk"
    title = "cross-talk of the load"
    on = ("lateral_force",)
    parameters = (Parameter("chi_z", "1", -0.1, 0.1, 0.005, description="cross-talk of the load", neutral=0.0),)
    conditions = (Condition("vertical_force", "N", None, "vertical load"),)
    candidate = False

    def term(self, s: Symbols) -> ca.SX:
        """Share of the load that the lateral channel shows."""
        return s.chi_z * s.vertical_force


class Delay(Effect):
    r"""Output :math:`F(t - \tau)`: transmission, anti-alias filter, channels sampled one after another.

    Negative: the input's channel lags behind. Fingerprint: phase proportional to f, whatever the speed.
    """

    name = "delay"
    title = "delay of the measurement"
    on = ("output",)
    parameters = (Parameter("tau_d", "s", -0.02, 0.05, 0.004, description="delay of the output", neutral=0.0),)
    states = washout_states(name, TARGET_UNIT)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output, delayed."""
        chain = Washout(s, self.states, value, washout_time(s))
        return chain.applied(delayed(chain, s.tau_d))


class SensorLowpass(Effect):
    r"""Output behind a first-order low-pass, :math:`T \dot F' = F - F'`: amplifier, filter, compliance of the hub.

    Fingerprint: a delay :math:`T`, and a loss of gain with f².
    """

    name = "sensor_lowpass"
    title = "low-pass of the sensor"
    on = ("output",)
    parameters = (Parameter("T_f", "s", 0.0, 0.1, 0.005, description="time constant of the filter", neutral=0.0),)
    states = washout_states(name, TARGET_UNIT)
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Output behind the filter."""
        chain = Washout(s, self.states, value, s.T_f + washout_time(s))
        return chain.applied(lagged(chain, s.T_f))
