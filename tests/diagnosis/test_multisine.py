"""A periodic multisine: whatever it excites may hold a gap."""

import numpy as np
import pytest
from damper_rig import NOISE

from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.spectral_classes import highest_harmonic
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.rig import run_plan

LINES = tuple(range(21, 62, 4))
CUBIC = {"cubic_stiffness": {"k_c": 3e8}}


def diagnosis(effects):
    """Of a damper under six periods of ten seconds, none of the first ten harmonics excited."""
    campaign = run_plan(
        plans.Plan(
            title="damper",
            model="kelvin_voigt_damper",
            seed=1,
            parameters={"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0},
            noise={"force": plans.NoisePlan(sd=NOISE)},
            effects=tuple(plans.EffectPlan(name=name, parameters=values) for name, values in effects.items()),
            tests=(
                plans.TestPlan(
                    name="dense",
                    kind="multisine",
                    sample_rate=100.0,
                    amplitude=0.01,
                    frequency=0.1,
                    lines=LINES,
                    periods=6,
                ),
            ),
        )
    )
    names = ("cubic_stiffness", "quadratic_damping", "dry_friction")
    return diagnose(campaign, find_model("kelvin_voigt_damper"), names, Settings(jobs=1))


def test_a_gap_on_excited_lines_above_the_tenth_counts() -> None:
    found = diagnosis(CUBIC)
    assert found.conclusion.verdict == "effect"
    assert found.conclusion.effects[0].name == "cubic_stiffness"
    assert found.before.gap > NOISE
    # of an odd multisine a cubic spring has odd harmonics
    by_class = {one.lines: one.gap for one in found.before.significant(0.01)}
    assert by_class["odd"] == pytest.approx(found.before.gap, rel=0.1)
    assert by_class.get("other", 0.0) < 0.2 * by_class["odd"]


def test_no_gap_is_found_on_them_where_there_is_none() -> None:
    found = diagnosis({})
    assert found.conclusion.verdict == "none"
    assert found.before.gap < 0.3 * NOISE


def test_what_is_excited_decides_on_the_highest_harmonic() -> None:
    turn = 2 * np.pi * np.arange(3000) / 1000
    assert highest_harmonic(np.sin(turn), 3) == 10
    assert highest_harmonic(1.0 + np.sin(turn) + np.sin(41 * turn) + 1e-3 * np.sin(307 * turn), 3) == 123
    # between harmonics it is no part of the period
    assert highest_harmonic(np.sin(turn) + 0.5 * np.sin(40.3333333333 * turn), 3) == 10
    assert highest_harmonic(np.zeros(3000), 3) == 10
