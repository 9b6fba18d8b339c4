"""A main cause is named although another one explains nearly as much: with that one, and no certainty."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import NOISE, SIMULATORS, damper_campaign

from mofit.data import Campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.identification.settings import Settings
from mofit.models import find_model

FINE = 20


def lagging(tau: float, at_force: float) -> Campaign:
    """The strokes of the quick rig; force from a formula, behind a lag that doubles at a force."""
    campaign, rng = damper_campaign(), np.random.default_rng(4)
    measured = []
    for m in campaign.measurements:
        one, count = m.experiment, len(m.experiment.time)
        assert one.frequency
        assert one.amplitude
        turn, step = 2 * np.pi * one.frequency, one.step / FINE
        before = 2 * round(1 / (one.frequency * one.step)) * FINE
        time = np.arange(-before, (count - 1) * FINE + 1) * step
        force = one.amplitude * (2000 * np.sin(turn * time) + 1500 * turn * np.cos(turn * time))
        behind = [force[0]]
        for now in force[:-1]:
            behind.append(behind[-1] + step * (now - behind[-1]) / (tau * (1 + abs(behind[-1]) / at_force)))
        noise = NOISE * rng.standard_normal(count)
        measured.append(replace(m, outputs={"force": np.array(behind)[before::FINE] + noise}))
    return replace(campaign, measurements=tuple(measured))


@pytest.mark.slow
def test_a_lag_by_another_law_is_named_with_the_relaxation_that_resembles_it() -> None:
    found = diagnose(
        lagging(0.005, 200.0),
        find_model("kelvin_voigt_damper"),
        ("sensor_lowpass", "second_branch", "dry_friction"),
        Settings(jobs=1),
        diagnosis=DiagnosisSettings(propose=False),
        simulators=SIMULATORS,
    ).conclusion
    assert found.verdict == "partly"
    assert found.sentence.startswith("Lag or delay causes most of the gap (best law: low-pass of the sensor); ")
    assert found.sentence.endswith(" These data cannot distinguish it from second Maxwell branch.")
    assert [family.name for family in found.families] == ["lag or delay", "relaxation"]
    assert found.group == ("sensor_lowpass", "second_branch")
    lag, branch = found.effects
    assert 0.5 < lag.probability < 0.95
    assert branch.probability > 0.05
