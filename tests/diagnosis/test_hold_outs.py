"""How far the gap shrinks by kind of hold-out: against known answers, and in all that tells of it."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from damper_rig import NOISE, SIMULATORS, damper_campaign, damper_diagnosis, truth

from mofit.cli import main
from mofit.data import Campaign, write_campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.groups import groups
from mofit.diagnosis.pages import diagnosis_page
from mofit.diagnosis.result import Diagnosis, summary
from mofit.diagnosis.shrinkage import HoldOut
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.rig import run_plan

FRICTION = (("dry_friction", (("F_d", 30.0),)),)
NAMES = ("cubic_stiffness", "delay")
MODEL = "kelvin_voigt_damper"
CUBE, SINH, SHARPNESS = "cube", "sinh", 4.0
CHIRP = plans.TestPlan(
    name="chirp", kind="chirp", sample_rate=100.0, amplitude=0.015, frequency=0.3, last_frequency=3.0, duration=20.0
)
SINES = tuple(
    plans.TestPlan(name=f"sine {k}", kind="sine", sample_rate=100.0, amplitude=a, frequency=f, periods=8)
    for k, (a, f) in enumerate(((0.02, 1.0), (0.02, 0.5), (0.01, 1.0), (0.01, 2.0), (0.005, 1.0), (0.005, 2.0)))
)


def clean_force(x: np.ndarray, time: np.ndarray, law: str) -> np.ndarray:
    """A damper, and a spring that stiffens to 240 N more at 20 mm: with the cube of the stroke, or with its sinh."""
    relative = x / 0.02
    stiff = relative**3 if law == CUBE else np.sinh(SHARPNESS * relative) / np.sinh(SHARPNESS)
    return np.asarray(2000 * x + 1500 * np.gradient(x, time) + 240 * stiff)


@cache
def stiffening(law: str) -> tuple[Campaign, dict[str, np.ndarray]]:
    """Six sines of three strokes and a chirp, and their forces without noise."""
    plan = plans.Plan(
        title="stiffening", model=MODEL, seed=1, noise={"force": plans.NoisePlan(sd=1.0)}, tests=(*SINES, CHIRP)
    )
    campaign, rng, clean = run_plan(plan), np.random.default_rng(4), {}
    measured = []
    for m in campaign.measurements:
        clean[m.name] = clean_force(m.channel("displacement"), m.time, law)
        measured.append(replace(m, outputs={"force": clean[m.name] + NOISE * rng.standard_normal(len(m.time))}))
    return replace(campaign, measurements=tuple(measured)), clean


@cache
def found_in(law: str) -> Diagnosis:
    campaign, _ = stiffening(law)
    model = find_model(MODEL)
    return diagnose(campaign, model, NAMES, Settings(jobs=1), hold_out="chirp", simulators=SIMULATORS)


def true_share(hold_outs: tuple[HoldOut, ...], clean: dict[str, np.ndarray]) -> float:
    """Share of the gap removed where nothing is hidden by noise."""
    squares = np.zeros(2)
    for one in (prediction for hold_out in hold_outs for prediction in hold_out.predictions):
        true = clean[one.test][one.start :][: len(one.after)]
        squares += [np.mean((side - true) ** 2) / np.ptp(true) ** 2 for side in (one.before, one.after)]
    return float(1 - squares[1] / squares[0])


def test_a_law_that_is_right_holds_on_every_kind_of_hold_out() -> None:
    found, (_, clean) = found_in(CUBE), stiffening(CUBE)
    assert found.conclusion.verdict == "effect"
    assert found.shrinkage is not None
    assert [one.kind for one in found.shrinkage.shares] == ["test", "group", "records"]
    for one in found.shrinkage.shares:
        assert one.share == pytest.approx(1.0, abs=0.02)
        assert one.low - 0.005 <= true_share(one.hold_outs, clean) <= one.high + 0.005
    assert found.shrinkage.caveat == ""


@pytest.mark.slow
def test_a_law_that_is_wrong_at_large_strokes_fails_without_them() -> None:
    """Fitted to small strokes the cube predicts far too much at large ones: the headline tells, a test alone hardly."""
    found, (_, clean) = found_in(SINH), stiffening(SINH)
    assert found.attribution.best.effects == ("cubic_stiffness",)
    assert found.shrinkage is not None
    alone, group = (found.shrinkage.of(kind) for kind in ("test", "group"))
    assert alone
    assert group
    largest = next(one for one in group.hold_outs if one.name == "largest amplitude")
    assert largest.tests == ("sine 0", "sine 1")
    assert group.share < alone.share - 0.1
    actual = true_share((largest,), clean)
    assert actual < true_share(alone.hold_outs, clean) - 0.1
    assert largest.low <= actual <= largest.high
    assert group.low <= true_share(group.hold_outs, clean) <= group.high


@pytest.mark.slow
def test_the_share_on_records_held_out_is_the_one_measured_there() -> None:
    found, (campaign, clean) = found_in(SINH), stiffening(SINH)
    assert found.shrinkage is not None
    headline = found.shrinkage.headline
    assert headline.kind == "records"
    (one,) = headline.hold_outs
    assert one.tests == ("chirp",)
    assert headline.share == pytest.approx(true_share(headline.hold_outs, clean), abs=0.02)
    assert headline.low < headline.share < headline.high
    # it had no part in anything else
    rest = campaign.select([name for name in campaign.tests if name != "chirp"])
    without = summary(diagnose(rest, find_model(MODEL), NAMES, Settings(jobs=1), simulators=SIMULATORS))
    told = summary(found)
    assert told["effects"] == without["effects"]
    assert told["shrinkage"]["kinds"][:2] == without["shrinkage"]["kinds"]


def test_groups_are_what_lies_beyond_the_other_tests() -> None:
    observed = damper_diagnosis(FRICTION).observed
    names = {one.name: [observed.problem.tests[k] for k in one.tests] for one in groups(observed)}
    assert names == {"largest amplitude": ["0.5Hz", "1Hz"], "highest frequency": ["4Hz"]}


def test_with_a_law_of_the_time_the_latest_tests_are_a_group() -> None:
    """Between tests that are fitted, it follows whatever changes slowly."""
    observed = damper_diagnosis(FRICTION).observed
    starts = {m.name: m.experiment.start_time for m in observed.problem.measurements}
    late = max(starts.values()) / 2**0.5
    (last,) = (one for one in groups(observed, [find_effect("drift:output")]) if one.later)
    assert "latest start" in last.name
    assert [observed.problem.tests[k] for k in last.tests] == [name for name, start in starts.items() if start > late]
    assert not any(one.later for one in groups(observed, [find_effect("dry_friction")]))


@pytest.mark.slow
def test_procedures_are_groups_that_leave_half_of_the_tests() -> None:
    campaign, _ = stiffening(CUBE)
    found = diagnose(campaign, find_model(MODEL), NAMES, Settings(jobs=1), simulators=SIMULATORS)
    chosen = {one.name: one.tests for one in groups(found.observed)}
    # the sines are more than half
    assert chosen["procedure chirp"] == (6,)
    assert "procedure sine" not in chosen
    assert set(chosen) == {"largest amplitude", "highest frequency", "procedure chirp"}


def test_tests_that_are_alike_make_no_group() -> None:
    """Half the power, or half an octave, is what differs clearly."""
    alike = [
        SINES[0].model_copy(update={"name": f"{k}", "amplitude": amplitude})
        for k, amplitude in enumerate((0.02, 0.018, 0.016, 0.015))
    ]
    plan = plans.Plan(
        title="alike", model=MODEL, seed=1, noise={"force": plans.NoisePlan(sd=NOISE)}, tests=tuple(alike),
        effects=(plans.EffectPlan(name="dry_friction", parameters={"F_d": 30.0}),),
    )  # fmt: skip
    found = diagnose(run_plan(plan), find_model(MODEL), ("dry_friction",), Settings(jobs=1), simulators=SIMULATORS)
    assert groups(found.observed) == []
    assert found.shrinkage is not None
    assert found.shrinkage.headline.kind == "test"
    assert found.shrinkage.sentence.startswith("On tests left out in turn it removes ")


@pytest.fixture(scope="module")
def campaign_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("campaign") / "stiffening.nc"
    write_campaign(stiffening(SINH)[0], file)
    return file


@pytest.mark.slow
def test_terminal_json_and_page_tell_one_story(campaign_file: Path, tmp_path: Path, capsys) -> None:
    options = ["diagnose", str(campaign_file), "--model", MODEL, "--jobs", "1", "--hold-out", "chirp"]
    options += [part for name in NAMES for part in ("--effects", name)]
    assert main([*options, "--out", str(tmp_path / "one")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    told = json.loads((tmp_path / "one" / "diagnosis.json").read_text())["shrinkage"]
    assert told["kind"] == "records"
    assert told["sentence"].startswith("On records held out (chirp) it removes ")
    assert told["sentence"] in shown
    page = (tmp_path / "one" / "diagnosis.html").read_text()
    assert told["sentence"] in page
    for label in ("tests left out in turn", "group: largest amplitude", "records held out: chirp"):
        assert label in shown
        assert label in page
    assert main([*options, "--json", "--out", str(tmp_path / "two")]) == 0
    assert json.loads(capsys.readouterr().out)["shrinkage"] == told


@pytest.mark.parametrize(
    ("tests", "hold_out", "words"),
    [
        ((), ["Chirp"], "Did you mean 'chirp'"),
        ((), [*(one.name for one in SINES), "chirp"], "leaves no test"),
        (["sine 0"], ["sine 0"], "leaves no test"),
    ],
)
def test_what_cannot_be_held_out_is_refused(tests: list[str], hold_out: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        diagnose(stiffening(SINH)[0], MODEL, NAMES, Settings(jobs=1), tests=tests, hold_out=hold_out)


def test_the_command_refuses_a_test_without_the_output(tmp_path: Path, capsys) -> None:
    campaign = damper_campaign()
    blind = [
        replace(m, outputs={"spare": m.outputs["force"]}, units={**m.units, "spare": "N"}) if m.name == "4Hz" else m
        for m in campaign.measurements
    ]
    write_campaign(replace(campaign, measurements=tuple(blind)), tmp_path / "blind.nc")
    options = ["diagnose", str(tmp_path / "blind.nc"), "--model", MODEL, "--out", str(tmp_path / "never")]
    assert main([*options, "--hold-out", "4Hz"]) == 2
    error = capsys.readouterr().err
    assert "4Hz" in error
    assert "channel 'force'" in error
    assert main([*options, "--hold-out", "nothing"]) == 2
    assert "nothing" in capsys.readouterr().err
    assert not (tmp_path / "never").exists()


def test_with_one_test_the_records_held_out_are_all_there_is() -> None:
    campaign, model = damper_campaign(FRICTION), find_model(MODEL)
    found = diagnose(campaign, model, ("dry_friction",), Settings(jobs=1), tests="1Hz", hold_out="2Hz")
    assert found.shrinkage is not None
    assert [one.kind for one in found.shrinkage.shares] == ["records"]
    assert found.shrinkage.headline.share > 0.95
    clean = truth(FRICTION)
    assert found.shrinkage.headline.share == pytest.approx(
        true_share(found.shrinkage.headline.hold_outs, clean), abs=0.03
    )
    assert found.shrinkage.sentence in diagnosis_page(found)._repr_html_()


def test_records_that_lack_what_the_effect_needs_have_no_share() -> None:
    """A drift needs the time at which a test began; without it the other shares stay."""
    found = damper_diagnosis((("drift", (("k_t", 0.002),)),), ("drift",))
    assert found.attribution.best.effects == ("drift",)
    (record,) = damper_campaign().select(["2Hz"]).measurements
    timeless = replace(record, experiment=replace(record.experiment, name="timeless", start_time=None))
    campaign = damper_campaign((("drift", (("k_t", 0.002),)),))
    whole = replace(campaign, measurements=(*campaign.measurements, timeless))
    again = diagnose(whole, find_model(MODEL), ("drift",), Settings(jobs=1), hold_out="timeless")
    assert again.shrinkage is not None
    assert summary(again)["shrinkage"]["kinds"] == summary(found)["shrinkage"]["kinds"]
    assert again.shrinkage.caveat.startswith("On the records held out no share is known: test 'timeless': ")
    assert "start_time" in again.shrinkage.caveat
