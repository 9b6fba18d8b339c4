"""Diagnosis of users' simulators: effects around them are found, those inside are told out of reach."""

import numpy as np
import pytest
from simulators import INPUTS, LINE, OUTPUTS
from straight_line import campaign, sine_test

from mofit.diagnosis.candidates import choose_effects
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.result import summary
from mofit.identification.settings import Settings
from mofit.models import Simulator


def spring(record, parameters):
    """F = k x: the offset of the tests is missing."""
    return parameters["k"] * record.inputs["displacement"]


def test_an_offset_is_found_behind_a_simulator():
    rig = campaign(*(sine_test(f"{size} m", size=size, seed=size) for size in (1, 2, 3, 4)))
    model = Simulator(spring, LINE[:1], INPUTS, OUTPUTS)
    found = summary(diagnose(rig, model, ("force_offset", "force_gain"), Settings(jobs=1, simulations=800)))
    assert [one["name"] for one in found["effects"]] == ["force_offset"]
    (offset,) = found["effects"]
    assert abs(offset["size"] - 0.5) < 4 * 0.3 / np.sqrt(4000)
    assert found["complete"]
    assert any("simulations. Effects that act inside" in text for text in found["warnings"])


def test_what_acts_inside_is_listed_as_out_of_reach():
    model = Simulator(spring, LINE[:1], INPUTS, OUTPUTS)
    chosen, left_out = choose_effects(model, campaign(sine_test()))
    assert "out of reach, inside the simulator 'spring'" in left_out["cubic_stiffness"]
    assert {"force_offset", "sensor_lowpass", "backlash"} <= {effect.name for effect in chosen}


@pytest.mark.slow
def test_a_diagnosis_without_simulations_left_says_so():
    rig = campaign(sine_test("a"), sine_test("b", size=2, seed=1))
    model = Simulator(spring, LINE[:1], INPUTS, OUTPUTS)
    found = summary(diagnose(rig, model, ("backlash",), Settings(jobs=1, simulations=126)))
    assert not found["complete"]
    assert found["sentence"].startswith("The simulations that are allowed did not suffice")
