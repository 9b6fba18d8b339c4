"""The sensors of the test rig: gain, offset and alignment."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Addition, Scaling
from mofit.models.model import Condition, Symbols
from mofit.parameters import PER_TEST, Parameter, powers

#: how forces grow with the data: on a tyre with its load
FORCE = (("force or vertical_force", 1.0),)


class ForceGain(Scaling):
    r"""Force :math:`(1 + g) F`: gain error of the transducer. Fingerprint: all harmonics alike."""

    name = "force_gain"
    title = "force gain"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    of_rig = True
    parameters = (Parameter("g_F", "1", -0.2, 0.2, 0.02, description="gain error of the force", neutral=0.0),)


class ForceOffset(Addition):
    r"""Force :math:`F + F_{off}`: conicity of a tyre, zero drift of a transducer. Fingerprint: mean value only."""

    name = "force_offset"
    title = "force offset"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    of_rig = True
    parameters = (
        Parameter("F_off", "N", -500.0, 500.0, 25.0, description="offset of the force", neutral=0.0, scales=FORCE),
    )


class TestOffset(Addition):
    r"""Force :math:`F + F_t`: zero drift of a transducer that is not set to zero before every test.

    Fingerprint: mean values that differ from test to test, whatever it is.
    """

    name = "test_offset"
    title = "force offset of each test"
    family = "sensor error"
    on = ("lateral_force", "longitudinal_force", "force")
    parameters = (
        Parameter(
            "F_t", "N", -500.0, 500.0, 25.0, description="offset of the force in a test", neutral=0.0, per=PER_TEST,
            scales=FORCE,
        ),
    )  # fmt: skip
    of_rig = True


class SlipOffset(Addition):
    r"""Slip angle :math:`\alpha + \alpha_0`: toe, ply steer, alignment. Fingerprint: mean value and second harmonic."""

    name = "slip_offset"
    title = "slip-angle offset"
    family = "sensor error"
    on = ("slip_angle",)
    of_rig = True
    # 0.08 degrees where the angle moves by two degrees to either side
    parameters = (
        Parameter(
            "alpha_0", "rad", -0.03, 0.03, 0.002, description="slip-angle offset", neutral=0.0,
            scales=powers(slip_angle=1),
        ),
    )  # fmt: skip


class CrossTalk(Addition):
    r"""Force :math:`F + \chi F_z`: tilted or coupled force transducer.

    At one load it is a force offset, so a diagnosis tries it only when named. Fingerprint: mean value,
    proportional to the load.
    """

    name = "cross_talk"
    title = "cross-talk of the load"
    family = "sensor error"
    on = ("lateral_force",)
    of_rig = True
    parameters = (Parameter("chi_z", "1", -0.1, 0.1, 0.005, description="cross-talk of the load", neutral=0.0),)
    conditions = (Condition("vertical_force", "N", None, "vertical load"),)
    candidate = False

    def term(self, s: Symbols) -> ca.SX:
        """Share of the load that the lateral channel shows."""
        return s.chi_z * s.vertical_force
