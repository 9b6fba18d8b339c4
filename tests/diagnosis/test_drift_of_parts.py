"""A part of the model that drifts over the campaign is named: drift, and which part."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import NOISE, SIMULATORS, damper_campaign

from mofit.data import Campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings
from mofit.models import find_model


def warming(spring: float, damper: float) -> Campaign:
    """The strokes of the quick rig; force from a formula, parts that lose these shares within the first tests."""
    campaign, rng = damper_campaign(), np.random.default_rng(5)
    measured = []
    for m in campaign.measurements:
        one, t = m.experiment, m.experiment.time
        assert one.start_time is not None
        assert one.frequency
        assert one.amplitude
        turn = 2 * np.pi * one.frequency
        x, v = one.amplitude * np.sin(turn * t), one.amplitude * turn * np.cos(turn * t)
        assert np.allclose(x, m.channel("displacement"))
        warm = 1 - np.exp(-(one.start_time + t) / 12.0)
        force = 2000 * (1 - spring * warm) * x + 1500 * (1 - damper * warm) * v
        measured.append(replace(m, outputs={"force": force + NOISE * rng.standard_normal(len(t))}))
    return replace(campaign, measurements=tuple(measured))


@pytest.mark.parametrize(("spring", "damper", "named"), [(0.3, 0.0, "spring"), (0.0, 0.1, "damper")])
def test_the_part_that_drifts_is_named(spring: float, damper: float, named: str) -> None:
    found = diagnose(
        warming(spring, damper), find_model("kelvin_voigt_damper"), settings=Settings(jobs=1), simulators=SIMULATORS
    )
    conclusion = found.conclusion
    assert conclusion.verdict == "effect"
    assert [family.name for family in conclusion.families] == ["drift"]
    (effect,) = conclusion.effects
    assert effect.name == f"drift:{named}_force"
    # relative change once it has ended
    end = effect.size * effect.parameters[f"drift_time_{named}_force"]
    assert end == pytest.approx(-(spring or damper), rel=0.15)
    assert conclusion.sentence.startswith(f"Drift causes the gap (best law: drift of the {named} force).")


def test_no_part_drifts_where_nothing_does() -> None:
    found = diagnose(
        warming(0.0, 0.0), find_model("kelvin_voigt_damper"), settings=Settings(jobs=1), simulators=SIMULATORS
    )
    assert found.conclusion.verdict == "none"
