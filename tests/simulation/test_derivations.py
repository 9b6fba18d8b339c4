"""Inputs that are derivatives, of derivatives too."""

import numpy as np
import pytest
from damper_rig import damper_campaign

from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings
from mofit.models import Channel, find_model
from mofit.models.model import derivations

OWN = """
import casadi as ca
from mofit.models import Addition, Applied, Channel, Effect
from mofit.parameters import Parameter


class OwnInertia(Addition):
    name, on = "own_inertia", ("damper_force",)
    inputs = (Channel("acceleration", "m/s^2", derivative_of="velocity"),)
    parameters = (Parameter("m_own", "kg", -50.0, 50.0, 1.0, neutral=0.0),)

    def term(self, s):
        return s.m_own * s.acceleration


class Asymmetric(Effect):
    name, on = "asymmetric_friction", ("damper_force",)
    parameters = (
        Parameter("F_out", "N", 0.0, 1e3, 30.0, neutral=0.0),
        Parameter("F_in", "N", 0.0, 1e3, 30.0, neutral=0.0),
        Parameter("delta_a", "m", 1e-5, 5e-2, 2e-3, "log", grid=(5e-4, 2e-3, 8e-3)),
    )
    states = (Channel("asymmetric", "1"),)

    def apply(self, s, value):
        z = s.asymmetric
        force = ca.if_else(z > 0, s.F_out, s.F_in) * z
        return Applied(value + force, {"asymmetric": (s.velocity - ca.fabs(s.velocity) * z) / s.delta_a})
"""
TRUTH = {
    "OwnInertia": {"m_own": 3.0},
    "Asymmetric": {"F_out": 40.0, "F_in": 20.0, "delta_a": 2e-3},
}


def test_a_chain_ends_at_the_measured_channel() -> None:
    chain = [
        Channel("angle", "rad"),
        Channel("rate", "rad/s", derivative_of="angle"),
        Channel("acceleration", "rad/s^2", derivative_of="rate"),
        Channel("speed", "m/s", derivative_of="place"),
    ]
    assert derivations(chain) == {
        "angle": ("angle", 0),
        "rate": ("angle", 1),
        "acceleration": ("angle", 2),
        "speed": ("place", 1),
    }
    assert derivations([Channel("x", "1", derivative_of="x")]) == {"x": ("x", 0)}


@pytest.mark.parametrize("kind", TRUTH)
def test_it_works_as_an_effect(kind, tmp_path) -> None:
    """Acceleration from a stroke alone; friction that differs between out and in."""
    (tmp_path / "own.py").write_text(OWN)
    name = f"{tmp_path / 'own.py'}:{kind}"
    campaign = damper_campaign(((name, tuple(TRUTH[kind].items())),))
    others = ("dry_friction", "quadratic_damping", "cubic_stiffness")
    found = diagnose(campaign, find_model("kelvin_voigt_damper"), (*others, name), Settings(jobs=1))
    assert found.conclusion.verdict == "effect"
    (effect,) = found.conclusion.effects
    assert effect.name not in others
    for parameter, value in TRUTH[kind].items():
        assert effect.parameters[parameter] == pytest.approx(value, rel=0.03)
    assert np.isfinite(list(found.nrmsd_after.values())).all()
