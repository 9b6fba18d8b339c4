"""Users' simulators through the whole identification, beside models with the same equations."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulators import Lagging, lagging_simulator, line_simulator
from straight_line import StraightLine, campaign, sine_test

import mofit
from mofit.errors import InputError
from mofit.identification.emulation import ACCEPTED
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import with_effects
from mofit.models.effects.rig import ForceOffset
from mofit.prediction import predict
from mofit.results import simulations, summary

ROOT = Path(__file__).resolve().parents[2]
RIG = (sine_test("a", periods=10), sine_test("b", periods=10, size=2.0, seed=1))


def posterior(model, settings, *tests):
    best, *_ = find_modes(campaign(*(tests or RIG)), model, settings)
    return best, best.chains.thinned().points.reshape(-1, len(best.minimum.point))


def test_the_posterior_is_that_of_the_same_equations():
    (equations, there), (function, here) = (
        posterior(model, Settings(seed=1, jobs=1)) for model in (StraightLine(), line_simulator())
    )
    sd = there.std(axis=0)
    # 1,000 effective draws: their means scatter by a thirtieth of a standard deviation
    assert np.abs(here.mean(axis=0) - there.mean(axis=0)) / sd == pytest.approx(0, abs=0.15)
    assert here.std(axis=0) / sd == pytest.approx(1, abs=0.1)
    assert np.abs(function.minimum.point - equations.minimum.point) / sd == pytest.approx(0, abs=0.02)
    assert function.emulator.error < 0.05
    assert function.sampled.problem.evaluations.count <= 2000
    assert equations.emulator is None


@pytest.mark.slow
def test_a_run_predicts_resumes_and_says_what_it_took(tmp_path):
    settings = Settings(seed=1, jobs=1, simulations=900)
    folder, tree = identify(
        campaign(*RIG, sine_test("c", periods=10, seed=2)), line_simulator(many=True), settings,
        hold_out="c", out=tmp_path / "run",
    )  # fmt: skip
    found = summary(tree, folder)
    assert found["simulations"] == simulations(tree)
    assert found["simulations"]["count"] <= 900
    assert found["simulations"]["limit"] == 900
    assert found["simulations"]["emulators"]["m1"]["error"] < 0.3
    assert found["trusted"]
    assert found["search"]["method"] == "surrogate"
    assert not (folder / "evaluations.sqlite").exists()
    assert "simulations" in (folder / "report.html").read_text(encoding="utf-8")
    (held_out,) = [row for row in found["held_out"]["tests"] if row["test"] == "c"]
    assert held_out["coverage"] == pytest.approx(0.9, abs=0.05)
    again = predict(tree, campaign(sine_test("d", seed=3)), model=line_simulator(many=True))
    assert float(again["coverage"].values[0]) == pytest.approx(0.9, abs=0.05)
    with pytest.raises(InputError, match="timeout"):
        predict(tree, campaign(sine_test("d", seed=3)), model=line_simulator(many=True), timeout=0.0)


def test_too_few_simulations_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError, match="too few for 2 tests and 2 free parameters"):
        identify(campaign(*RIG), line_simulator(), Settings(simulations=20), out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_where_the_limit_ends_it_the_error_of_the_emulator_says_whether_it_is_trusted():
    modes = find_modes(campaign(*RIG), lagging_simulator(), Settings(seed=5, jobs=1, simulations=182))  # the fewest
    (mode, *_) = modes
    assert mode.sampled.problem.main.evaluations.count <= 182
    # how near it comes with so few is a matter of luck
    finding = mode.emulator.finding("m1")
    assert (finding is None) == (mode.emulator.error <= ACCEPTED)
    finding = replace(mode.emulator, error=2 * ACCEPTED).finding("m1")
    assert finding.level == "untrusted"
    assert "--simulations" in finding.text
    assert Lagging.name == "lagging"


@pytest.mark.parametrize("allowed", [240, *(pytest.param(number, marks=pytest.mark.slow) for number in (400, 600))])
def test_few_simulations_end_in_a_result_whatever_their_number(allowed):
    """Search, descents, wider ranges and emulator share what there is."""
    modes = find_modes(campaign(*RIG), lagging_simulator(), Settings(seed=1, jobs=1, simulations=allowed))
    assert modes[0].sampled.problem.main.evaluations.count <= allowed


def test_an_effect_behind_the_simulator_is_estimated():
    model = with_effects(line_simulator(), ForceOffset())
    best, _ = posterior(model, Settings(seed=1, jobs=1, fixed={"b": 0.0}))
    problem = best.sampled.problem.main
    offset = dict(zip(problem.space.names, problem.space.from_unit(best.minimum.point), strict=True))["F_off"]
    assert offset == pytest.approx(0.5, abs=0.05)


def test_equations_know_no_simulations():
    settings = Settings().for_model(StraightLine())
    assert (settings.search, settings.simulations) == ("effa", None)
    assert "simulations" not in settings.deciding()
    assert Settings().for_model(line_simulator()).simulations == 2000


@pytest.mark.slow
def test_the_template_is_identified(tmp_path):
    template = mofit.find_model(str(ROOT / "examples" / "own_simulator.py"))
    assert template.parameters
    from mofit.cli import main

    file = tmp_path / "campaign.nc"
    time = np.arange(100) * 0.01
    x = 0.02 * np.sin(2 * np.pi * 2 * time)
    record = mofit.Record("a", time, {"displacement": x}, {})
    force = template.function(record, {"k": 2e4, "d": 400.0, "c": 5e4})
    force = force + np.random.default_rng(0).normal(size=len(time))
    experiment = mofit.Experiment("a", "sine", time, {"displacement": x}, {}, 2.0, 0.02)
    test = mofit.Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"})
    mofit.write_campaign(mofit.Campaign("rig", "simulated", {}, (test,)), file)
    out = tmp_path / "run"
    code = main([
        "identify", str(file), "--model", f"{ROOT / 'examples' / 'own_simulator.py'}:damper", "--simulations", "300",
        "--out", str(out), "--jobs", "1",
    ])  # fmt: skip
    assert code == 0
    best = mofit.open(out)["modes/m1"].dataset
    truth = {"k": 2e4, "d": 400.0, "c": 5e4}
    for name, value in truth.items():
        one = best.sel(parameter=name)
        assert abs(float(one["mean"]) - value) < 4 * float(one["sd"])
    assert json.loads(mofit.open(out).attrs["simulations"])["count"] <= 300
