"""The positioning system EMPS: identified on one record, another with pulses of the motor force predicted.

In the loop the position is that of the controller, whatever the drive is. So the model is simulated in open loop, from
the measured motor force alone: the speed is stable, and the position integrates every error of the speed over 25 s.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca

from mofit.data import Campaign, Measurement
from mofit.models import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter
from records_cases.case import Case, imported, with_inputs

#: speed below which Coulomb friction is viscous, m/s; the drive moves at up to 0.1 m/s
SLOW = 1e-3


class Drive(Model):
    """M q'' = F - F_v q' - F_c tanh(q' / v_s) - F_0 from rest at q_0; motor force in, position out."""

    name = "drive"
    title = "drive with friction"
    parameters = (
        Parameter("M", "kg", 10.0, 1e3, 100.0, "log", "moving mass"),
        Parameter("F_v", "N s/m", 10.0, 1e3, 100.0, "log", "viscous friction"),
        Parameter("F_c", "N", 1.0, 1e2, 10.0, "log", "Coulomb friction"),
        Parameter("F_0", "N", -20.0, 20.0, 0.0, description="offset of the force"),
        Parameter("q_0", "m", -0.05, 0.05, 0.0, description="position at the start"),
    )
    states = (Channel("position", "m"), Channel("velocity", "m/s"))
    inputs = (Channel("force", "N"),)
    outputs = (Channel("displacement", "m"),)

    def equations(self, s: Symbols) -> Equations:
        """Newton's law."""
        friction = s.quantity("damper_force", s.F_v * s.velocity + s.F_c * ca.tanh(s.velocity / SLOW))
        return Equations(
            outputs={"displacement": s.position},
            derivatives={"position": s.velocity, "velocity": (s.force - friction - s.F_0) / s.M},
            initial={"position": s.q_0},
        )


def forward(one: Measurement) -> Measurement:
    """The record the other way round: the motor force is the input, the position the output."""
    position, force = one.experiment.inputs["displacement"], one.outputs["force"]
    return replace(one, experiment=replace(one.experiment, inputs={"force": force}), outputs={"displacement": position})


def campaign(data: Path) -> Campaign:
    """Both records, forward; the motor force, which jumps, runs straight between samples."""
    found = imported(data, "emps")
    return with_inputs("linear", replace(found, measurements=tuple(map(forward, found.measurements))))


CASES = (
    Case(
        "emps", "Positioning system EMPS", Drive, campaign,
        lambda test: test == "trajectory", ("pulses",), ("mm", 1e3),
        "what is reached; least squares on the force give M 95.0 kg, F_v 201.6 N s/m, F_c 20.6 N, F_0 -3.24 N",
    ),
)  # fmt: skip
