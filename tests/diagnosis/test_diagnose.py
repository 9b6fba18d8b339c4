"""The whole diagnosis on a quick rig: none, one, several, unknown."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damper_rig import damper_campaign, damper_diagnosis, truth

from mofit.diagnosis.baseline import set_up
from mofit.diagnosis.conclusion import conclude
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.next_experiment import next_experiment, proposals, usual_sine
from mofit.diagnosis.result import summary
from mofit.diagnosis.settings import DiagnosisSettings, NextExperimentSettings
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.runtime.parallel import may_fork

FRICTION = (("dry_friction", (("F_d", 30.0),)),)
TWO = (("quadratic_damping", (("d_2", 1500.0),)), ("cubic_stiffness", (("k_c", 8e6),)))
KEYS = {"verdict", "sentence", "effects", "group", "where", "shrinkage", "next_experiment", "noise_floor", "seconds"}


def test_no_gap_is_found_where_there_is_none() -> None:
    found = damper_diagnosis()
    assert found.conclusion.verdict == "none"
    assert found.conclusion.effects == ()
    assert found.shrinkage is None
    assert found.shrinkage_reason == "there is no gap"


def test_friction_is_named_with_its_size_and_what_it_hides() -> None:
    found = damper_diagnosis(FRICTION)
    assert found.conclusion.verdict == "effect"
    (effect,) = found.conclusion.effects
    assert effect.name == "dry_friction"
    assert effect.probability > 0.99
    assert effect.size_low < 30.0 < effect.size_high
    assert effect.size == pytest.approx(30.0, rel=0.02)
    assert found.attribution.best_residuals.p_value > 0.01
    assert max(found.nrmsd_after.values()) < 0.3 * max(found.nrmsd_before.values())


TOO_STIFF = """
import casadi as ca
from mofit.models import Applied, Channel, Effect
from mofit.parameters import Parameter

class Sensor(Effect):
    name, on = "sensor", ("output",)
    parameters = (Parameter("gain", "1", -1, 1, 0.1, neutral=0.0),)
    states = (Channel("shown", "N"),)

    def apply(self, s, value):
        return Applied(value + s.gain * s.shown, {"shown": 1e6 * (value - s.shown)}, initial={"shown": value})
"""


def test_what_cannot_be_integrated_is_left_out_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(TOO_STIFF, encoding="utf-8")
    names = ("dry_friction", f"{tmp_path / 'own.py'}:Sensor")
    found = diagnose(damper_campaign(FRICTION), find_model("kelvin_voigt_damper"), names, Settings(jobs=1))
    assert found.conclusion.effects[0].name == "dry_friction"
    assert {one.name for one in found.attribution.score_tests} == {"dry_friction"}
    assert "too stiff" in found.left_out["sensor"]
    outcomes = {one["name"]: one["outcome"] for one in summary(found)["accounts"]}
    assert outcomes == {"dry_friction": "fitted", "sensor": "could not be fitted"}


@pytest.mark.parametrize("effect", ["springpot", "backlash"])
def test_slowly_sampled_records_are_integrated(effect: str) -> None:
    """At 20 Hz: what these effects hold of their own is much faster than the samples."""
    campaign = damper_campaign()
    slow = [
        replace(m, experiment=replace(m.experiment, time=5 * m.experiment.time, frequency=m.experiment.frequency / 5))
        for m in campaign.measurements
    ]
    found = diagnose(
        replace(campaign, measurements=tuple(slow)), find_model("kelvin_voigt_damper"), (effect,), Settings(jobs=1)
    )
    assert [one.name for one in found.attribution.score_tests] == [effect]
    assert found.left_out.keys().isdisjoint({effect})


@pytest.mark.parametrize("faster", [0.1, 1, 1000])
def test_next_tests_are_tried_on_a_bounded_number_of_samples(faster: float) -> None:
    campaign, model = damper_campaign(), find_model("kelvin_voigt_damper")
    measured = [
        replace(m, experiment=replace(m.experiment, time=m.experiment.time / faster)) for m in campaign.measurements
    ]
    observed, _ = set_up(model, replace(campaign, measurements=tuple(measured)), Settings(jobs=1))
    usual = usual_sine(observed)
    assert usual is not None
    assert usual.frequency == pytest.approx(4 * faster)
    proposed = list(proposals(observed, usual, NextExperimentSettings()))
    assert len(proposed) > 10
    assert max(len(one.time) for one in proposed) <= 4000
    assert min(one.time[-1] * (one.frequency or 0) for one in proposed) > 3.9


def test_a_diagnosis_shows_its_page_in_a_notebook() -> None:
    found = damper_diagnosis(FRICTION)
    shown = found._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    page = html.unescape(shown)
    assert "Diagnosis of the gap" in page
    assert found.conclusion.sentence in page
    assert not re.findall(r'(?:src|href)="(?!data:|#|about:)', page)


def test_shrinkage_is_that_of_the_truth() -> None:
    shrinkage, clean = damper_diagnosis(FRICTION).shrinkage, truth(FRICTION)
    assert shrinkage is not None
    found = shrinkage.of("test")
    assert found is not None
    left = [
        np.mean((clean[one.test][one.start :][: len(one.after)] - prediction) ** 2) / np.ptp(clean[one.test]) ** 2
        for prediction_of in ("before", "after")
        for hold_out in found.hold_outs
        for one in hold_out.predictions
        for prediction in [getattr(one, prediction_of)]
    ]
    half = len(left) // 2
    actual = 1 - sum(left[half:]) / sum(left[:half])
    assert found.share == pytest.approx(actual, abs=0.01)
    assert shrinkage.predicted == pytest.approx(actual, abs=0.02)
    assert found.low - 0.01 < actual < found.high + 0.01


def test_two_effects_at_once_are_both_named() -> None:
    found = damper_diagnosis(TWO)
    assert found.conclusion.verdict == "several"
    assert found.attribution.best.effects == ("cubic_stiffness", "quadratic_damping")


@pytest.mark.parametrize(("behind", "doubtful"), [(1.0, True), (2.0, False)])
def test_beside_several_effects_only_close_models_are_named(behind: float, doubtful: bool) -> None:
    found = damper_diagnosis(TWO)
    best, *others = found.attribution.models
    other = next(one for one in others if len(one.effects) > 1)
    close = replace(other, criterion=best.criterion + behind)
    attribution = replace(found.attribution, models=(best, close, others[-1]))
    conclusion = conclude(attribution, found.before, found.after, DiagnosisSettings())
    assert conclusion.verdict == "several"
    assert bool(conclusion.group) == doubtful


def test_without_the_right_effect_none_is_named() -> None:
    found = damper_diagnosis(FRICTION, ("cubic_stiffness", "quadratic_damping", "delay", "inertia"))
    assert found.conclusion.verdict == "unknown"
    assert found.next_experiment is None
    assert found.shrinkage is None
    assert "none of the known effects" in found.shrinkage_reason.lower()


def test_indistinguishable_effects_are_a_group_with_a_next_experiment() -> None:
    """A weak filter behind the transducer is a delay as far as four low frequencies can tell."""
    found = damper_diagnosis((("sensor_lowpass", (("T_f", 0.0015),)),), ("delay", "sensor_lowpass"))
    assert found.conclusion.verdict == "group"
    assert set(found.conclusion.group) == {"delay", "sensor_lowpass"}
    assert found.next_experiment is not None
    assert found.next_experiment.frequency >= 4.0


@pytest.mark.slow
def test_the_next_experiment_also_discriminates_what_is_not_ruled_out() -> None:
    """Beside a lag and the delay it resembles, a second branch is less probable, but not a hundred times."""
    lag = (("sensor_lowpass", (("T_f", 0.0002),)),)
    found = damper_diagnosis(lag, ("delay", "sensor_lowpass", "second_branch", "dry_friction"))
    assert set(found.conclusion.group) == {"delay", "sensor_lowpass"}
    assert found.next_experiment is not None
    assert not found.next_experiment.resolves
    # no sine distinguishes a lag so short from a delay reliably
    assert found.next_experiment.power < 0.2
    assert "second_branch" in found.next_experiment.sentence
    assert "dry_friction" not in found.next_experiment.sentence
    # with a probability of 80 % both are distinguished from the branch
    lenient = NextExperimentSettings(power=0.8)
    again = next_experiment(found.observed, found.attribution.models[:3], lenient)
    assert again is not None
    assert {*again.discriminates} == {("delay", "second_branch"), ("sensor_lowpass", "second_branch")}
    assert "distinguishes 2 of 3 pairs" in again.sentence


def test_summary_is_plain_data_with_the_promised_keys() -> None:
    found = summary(damper_diagnosis(FRICTION))
    assert set(found) >= KEYS
    again = json.loads(json.dumps(found, allow_nan=False))
    assert again["effects"][0].keys() >= {"name", "probability", "size", "size_low", "size_high", "unit"}
    assert again["shrinkage"].keys() >= {"predicted", "kind", "share", "low", "high", "kinds"}


def test_the_same_seed_gives_the_same_numbers() -> None:
    first = summary(damper_diagnosis(FRICTION))
    model = find_model("kelvin_voigt_damper")
    second = summary(diagnose(damper_campaign(FRICTION), model, (), Settings(jobs=2)))
    first.pop("seconds"), second.pop("seconds")
    assert first == second


def test_an_effect_that_does_not_fit_is_refused() -> None:
    model = find_model("kelvin_voigt_damper")
    with pytest.raises(InputError, match="slip_offset"):
        diagnose(damper_campaign(), model, ("slip_offset",), Settings(jobs=1))
    with pytest.raises(InputError, match="unknown name"):
        diagnose(damper_campaign(), model, ("no_such",), Settings(jobs=1))


CUBE = """
from mofit.models import Applied, Effect
from mofit.parameters import Parameter

class Cube(Effect):
    name, on, needs = "cube", ("damper_force",), ("velocity",)
    parameters = (Parameter("k_v", "N s^3/m^3", -1e6, 1e6, 1e3, neutral=0.0),)

    def apply(self, s, value):
        return Applied(value + s.k_v * s.velocity**3)
"""


@pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")
def test_results_do_not_depend_on_the_number_of_processes(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(CUBE, encoding="utf-8")  # a class that no process could send
    names = ("dry_friction", "delay", "quadratic_damping", f"{tmp_path / 'own.py'}:Cube")
    campaign, model = damper_campaign(FRICTION), find_model("kelvin_voigt_damper")
    told = list[str]()

    def listen(stage: str, done: float, total: float, note: str) -> None:
        told.append(note)

    one, two = (summary(diagnose(campaign, model, names, Settings(jobs=jobs), progress=listen)) for jobs in (1, 2))
    assert two["verdict"] == "effect"
    assert {**one, "seconds": 0} == {**two, "seconds": 0}
    assert told.count("cube") == 4  # its score test and its refit, twice
