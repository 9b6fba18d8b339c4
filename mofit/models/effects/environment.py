"""Other conditions than in the calibration or at the start: speed, grip, stiffness, drift and warm-up."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import CALIBRATION_ERROR, Scaling
from mofit.models.model import TIME, Condition, Symbols
from mofit.parameters import Parameter, powers


class Speed(Scaling):
    r"""True speed :math:`(1 + e) v`.

    Fingerprint: odd harmonics; the lag of the carcass scales with 1/v, the steady state does not.
    """

    name = "speed"
    title = "speed error"
    family = "speed error"
    on = ("longitudinal_velocity",)
    parameters = (Parameter("e_v", "1", -0.3, 0.3, 0.03, description="relative error of the speed", neutral=0.0),)


class CorneringStiffness(Scaling):
    r"""Initial slope :math:`(1 + e) \, dF_0`: temperature, wear or load differ from those of the step tests.

    Fingerprint: odd harmonics, all frequencies, most at small slip.
    """

    name = "cornering_stiffness"
    title = "error of the cornering stiffness"
    family = CALIBRATION_ERROR
    on = ("dF0",)
    parameters = (
        Parameter("e_alpha", "1", -0.5, 0.5, 0.05, description="relative error of the initial slope", neutral=0.0),
    )


class FrictionLevel(Scaling):
    r"""Maximum force :math:`(1 + e) F_M`: surface, temperature or wear differ from those of the step tests.

    Fingerprint: odd harmonics, growing with slip.
    """

    name = "friction_level"
    title = "error of the friction level"
    family = CALIBRATION_ERROR
    on = ("F_M",)
    parameters = (
        Parameter("e_mu", "1", -0.5, 0.5, 0.08, description="relative error of the maximum force", neutral=0.0),
    )


class CarcassStiffness(Scaling):
    r"""Stiffness :math:`(1 + e) c_y`: pressure, temperature or rolling differ from the quasi-static test.

    Fingerprint: odd harmonics, growing with f as the lag of the carcass does.
    """

    name = "carcass_stiffness"
    title = "error of the carcass stiffness"
    family = CALIBRATION_ERROR
    on = ("c_y",)
    parameters = (
        Parameter("e_y", "1", -0.5, 0.5, 0.06, description="relative error of the carcass stiffness", neutral=0.0),
    )


class Drift(Scaling):
    r"""Output times :math:`1 + k (t_0 + t)`, with the test's start :math:`t_0` since the campaign began.

    Wear, temperature, a drifting amplifier. Fingerprint: follows the run order, and only seemingly the frequency.
    """

    name = "drift"
    title = "drift over the campaign"
    family = "drift"
    on = ("output",)
    # -4 % in a quarter of an hour
    parameters = (
        Parameter(
            "k_t",
            "1/s",
            -1e-3,
            1e-3,
            -4.5e-5,
            description="relative change of gain per time",
            neutral=0.0,
            scales=powers(time=-1),
        ),
    )
    inputs = (TIME,)
    conditions = (Condition("start_time", "s", None, "time since the campaign began"),)

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Change of gain up to this moment."""
        return s.k_t * (s.start_time + s.time)


class WarmUp(Scaling):
    r"""Output times :math:`1 + w e^{-t / \tau}`: the specimen warms in every run anew.

    Fingerprint: skirts around the excitation's lines, most in short tests.
    """

    name = "warm_up"
    title = "warm-up within a run"
    family = "drift"
    on = ("output",)
    parameters = (
        Parameter("w_t", "1", -0.5, 0.5, 0.02, description="relative excess of gain at the first sample", neutral=0.0),
        Parameter(
            "tau_t",
            "s",
            0.1,
            1e3,
            3.0,
            "log",
            "time in which it fades",
            grid=(1.0, 4.0, 15.0),
            scales=powers(time=1),
        ),
    )
    inputs = (TIME,)

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Excess of gain that is left."""
        return s.w_t * ca.exp(-s.time / s.tau_t)
