"""A part that rotates beside a damper, at angles that nobody wrote down."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import SIMULATORS, damper_campaign

from mofit.data import Campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.spectral_classes import rotational_orders
from mofit.identification.settings import Settings

#: rad/s, as the nameplate says it; what turns is 0.3 % faster
SPEED, FASTER = 37.0, 1.003
CANDIDATES = ("shaft_order", "dry_friction", "quadratic_damping", "cubic_stiffness", "delay", "test_offset")


def rotating(amplitude: float, seed: int = 1) -> Campaign:
    """The damper's sines, each with a line at an angle of its own."""
    rng = np.random.default_rng(seed)
    tests = []
    for one in damper_campaign(seed=seed).measurements:
        time = one.experiment.time - one.experiment.time[0]
        line = amplitude * np.cos(FASTER * SPEED * time + rng.uniform(0, 2 * np.pi))
        experiment = replace(one.experiment, conditions={**one.experiment.conditions, "rotational_speed": SPEED})
        tests.append(replace(one, experiment=experiment, outputs={"force": one.outputs["force"] + line}))
    return replace(damper_campaign(seed=seed), measurements=tuple(tests))


@pytest.mark.parametrize("amplitude", [0.0, 3.0])
def test_the_order_of_a_shaft_is_named_with_its_amplitude_and_speed(amplitude: float) -> None:
    found = diagnose(rotating(amplitude), "kelvin_voigt_damper", CANDIDATES, Settings(jobs=1), simulators=SIMULATORS)
    assert [one.name for one in found.conclusion.effects] == (["shaft_order"] if amplitude else [])
    assert found.conclusion.verdict == ("effect" if amplitude else "none")
    for effect in found.conclusion.effects:
        assert effect.size_low < amplitude < effect.size_high
        assert effect.parameters["e_o"] == pytest.approx(FASTER - 1, abs=1.5e-3)
        assert effect.of_rig
        assert effect.unit == "N"


def test_a_stated_speed_is_an_order() -> None:
    (*_, last) = rotating(0.0).measurements
    assert rotational_orders(last) == {"shaft": pytest.approx(SPEED / (2 * np.pi))}
