"""The right cause with another law is named partly: with its family, what is left, and no certainty."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from damper_rig import NOISE, SIMULATORS, damper_campaign, damper_diagnosis

from mofit.data import Campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.pages import diagnosis_page
from mofit.diagnosis.pages.effects import effects_section
from mofit.diagnosis.result import Diagnosis, page_data, summary
from mofit.identification.settings import Settings
from mofit.models import effect_names, find_effect, find_model

COULOMB, STATIC, STRIBECK_SPEED = 20.0, 60.0, 0.05


def stribeck_campaign() -> Campaign:
    """The strokes of the quick rig; force from a formula, with friction that falls with speed."""
    campaign, rng = damper_campaign(), np.random.default_rng(3)
    measured = []
    for m in campaign.measurements:
        x, t = m.channel("displacement"), m.experiment.time
        v = np.gradient(x, t)
        level = COULOMB + (STATIC - COULOMB) * np.exp(-((v / STRIBECK_SPEED) ** 2))
        force = 2000 * x + 1500 * v + level * np.tanh(v / 1e-3) + NOISE * rng.standard_normal(len(t))
        measured.append(replace(m, outputs={"force": force}))
    return replace(campaign, measurements=tuple(measured))


@cache
def stribeck(candidates: tuple[str, ...] = ()) -> Diagnosis:
    model = find_model("kelvin_voigt_damper")
    return diagnose(stribeck_campaign(), model, candidates, Settings(jobs=1), simulators=SIMULATORS)


@pytest.mark.slow
def test_friction_with_a_law_of_its_own_is_friction_for_the_most_part() -> None:
    found = stribeck()
    conclusion = found.conclusion
    assert conclusion.verdict == "partly"
    assert [effect.name for effect in conclusion.effects] == ["dry_friction"]
    assert [family.name for family in conclusion.families] == ["friction"]
    assert conclusion.sentence.startswith("Friction causes most of the gap (best law: dry friction (Dahl)); ")
    assert "most of it on odd harmonics" in conclusion.sentence
    alone = found.shrinkage and found.shrinkage.of("test")
    assert alone
    assert alone.share == pytest.approx(1 - conclusion.residual_share, abs=0.1)
    assert found.next_experiment is None


@pytest.mark.slow
def test_a_law_that_misses_is_not_certain() -> None:
    conclusion = stribeck().conclusion
    (friction,) = conclusion.families
    assert 0.5 < friction.probability < 0.99
    assert sum(conclusion.probabilities) == pytest.approx(1.0)
    (certain,) = damper_diagnosis((("dry_friction", (("F_d", 30.0),)),)).conclusion.families
    assert certain.probability > 0.99


@pytest.mark.slow
def test_json_and_page_say_what_is_left_and_where() -> None:
    found = summary(stribeck())
    assert found["verdict"] == "partly"
    assert found["residual"]["share"] == stribeck().conclusion.residual_share
    assert found["residual"]["location"]["lines"] == "odd"
    assert found["residual"]["location"]["share"] > 0.5
    assert found["effects"][0]["family"] == "friction"
    assert found["families"] == [{"name": "friction", "probability": found["effects"][0]["probability"]}]
    assert "Friction causes most of the gap" in diagnosis_page(stribeck())._repr_html_()


def test_without_the_right_family_the_cause_stays_unknown() -> None:
    found = stribeck(("cubic_stiffness", "quadratic_damping", "delay", "inertia"))
    assert found.conclusion.verdict == "unknown"
    assert found.shrinkage is None


def test_every_shipped_effect_has_a_family() -> None:
    families = {name: find_effect(name).family for name in effect_names()}
    assert [name for name, family in families.items() if not family] == []
    assert families["dry_friction"] == families["coulomb_friction"] == families["bouc_wen"]
    assert len(set(families.values())) < len(families)


def test_the_bias_of_a_parameter_that_is_zero_is_no_percentage() -> None:
    """An offset of 1e-3 N ± 0.5 N that was 5 N without the effect: not a bias of 500 000 %, but of ten deviations."""
    found = page_data(damper_diagnosis((("dry_friction", (("F_d", 30.0),)),)))
    found["model_parameters"]["F_0"] |= {"before": 5.001, "after": 1e-3, "sd": 0.5}
    table = effects_section(found).blocks[-1]
    columns = {
        str(column.head): dict(zip(found["model_parameters"], column.cells, strict=True)) for column in table.columns
    }
    assert (columns["Bias"]["F_0"], columns["Bias / sd"]["F_0"]) == ("5", "10")
    assert "biased" in columns[""]["F_0"]
    assert not any("%" in cell for column in columns.values() for cell in column.values())
