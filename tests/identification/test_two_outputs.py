"""Several outputs, each with its noise and objective, against weighted least squares."""

import json
from dataclasses import replace

import numpy as np
import pytest
from two_outputs import NOISE, UNITS, campaign, weighted_least_squares, write_rig

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, write_campaign
from mofit.errors import InputError
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.search_weights import search_weights
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import find_model
from mofit.plots import errors, loop
from mofit.problem import build_problem
from mofit.results import objectives, open_result, per_objective

HALF = {"0.5 Hz": "acceleration", "2 Hz": "acceleration"}
MIXED = {"0.5 Hz": "force", "2 Hz": "acceleration"}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return find_model(write_rig(tmp_path_factory.mktemp("rig"))[1])


@pytest.mark.parametrize("lacking", [{}, HALF, MIXED], ids=["all", "half without the quiet one", "mixed"])
def test_posterior_is_that_of_weighted_least_squares(model, lacking):
    """Noises and units differ by orders of magnitude; means agree within the noise's share of what is sampled."""
    tests = campaign(lacking)
    (mode,) = find_modes(tests, model, Settings(jobs=1))
    space = mode.sampled.space
    draws = space.from_unit(mode.chains.thinned().points.reshape(-1, len(space)))
    problem = build_problem(model, tests)
    used = {e.name: e.weights.any(axis=1) for e in problem.experiments}
    mean, covariance = weighted_least_squares(tests, lambda test: used[test.name])
    sd = np.sqrt(np.diag(covariance))
    assert space.names == ("a", "b")
    assert np.abs((draws.mean(axis=0) - mean) / sd).max() < 0.15
    assert np.abs(draws.std(axis=0) / sd - 1).max() < 0.15


def test_every_output_of_a_test_is_an_objective_with_its_own_noise(model):
    problem = build_problem(model, campaign(MIXED))
    assert problem.tests == ("0.5 Hz", "1 Hz", "2 Hz", "4 Hz")
    assert problem.objective_names == (
        *("0.5 Hz / acceleration", "1 Hz / force", "1 Hz / acceleration"),
        *("2 Hz / force", "4 Hz / force", "4 Hz / acceleration"),
    )
    for name, floor in zip(problem.objective_names, problem.noise.floor, strict=True):
        test, channel = name.split(" / ")
        measured = problem.measurements[problem.tests.index(test)].channel(channel)
        assert floor == pytest.approx(NOISE[channel] / np.ptp(measured), rel=0.2)
    some = problem.select(["4 Hz", "0.5 Hz"])
    assert some.objective_names == ("4 Hz / force", "4 Hz / acceleration", "0.5 Hz / acceleration")
    u = np.array([[0.3, 0.4], [0.6, 0.2]])
    np.testing.assert_array_equal(some.objectives(u), problem.objectives(u)[:, [4, 5, 0]])
    values, slopes = problem.gradients(u)
    for k, step in enumerate(1e-6 * np.eye(2)):
        central = (problem.objectives(u + step) - problem.objectives(u - step)) / 2e-6
        np.testing.assert_allclose(slopes[:, :, k], central, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(values, problem.objectives(u))


def test_weights_name_a_test_or_one_of_its_outputs(model):
    problem = build_problem(model, campaign(MIXED))
    weights = search_weights(problem, {"1 Hz": 3.0, "1 Hz / force": 2.0, "4 Hz": 0.5})
    np.testing.assert_array_equal(weights, [1.0, 2.0, 3.0, 1.0, 0.5, 0.5])
    with pytest.raises(InputError, match="no test '2 Hz / acceleration'"):
        search_weights(problem, {"2 Hz / acceleration": 1.0})


def without(test: Measurement, *names: str) -> Measurement:
    return replace(test, outputs={name: values for name, values in test.outputs.items() if name not in names})


def test_a_test_without_any_output_is_refused_and_an_output_without_a_test_is_told(model):
    tests = campaign()
    bare = replace(tests, measurements=(without(tests.measurements[0], *NOISE), *tests.measurements[1:]))
    with pytest.raises(InputError, match=r"test '0\.5 Hz': .*at least one of the channels 'force', 'acceleration'"):
        build_problem(model, bare)
    forces = Campaign("beam", "simulated", {}, tuple(without(test, "acceleration") for test in tests.measurements))
    setup = set_up_problem(model, forces, Settings(jobs=1))
    assert setup.searched.objective_names[0] == "0.5 Hz / force"
    assert any("acceleration" in warning for warning in setup.warnings)


@pytest.mark.slow
def test_a_run_carries_all_outputs_to_tree_page_and_table(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, reference = write_rig(tmp_path, lacking=MIXED)
    command = ["identify", str(path), "--model", reference, "--out", "run", "--weights", "1 Hz / force=2"]
    assert main(command) == 0
    shown = capsys.readouterr().out
    assert all(text in shown for text in ("4 Hz", "acceleration", "NRMSD of every output"))
    tree = open_result("run")
    names = [one.name for one in objectives(tree)]
    assert len(names) == 6
    assert tree["noise_sd"].dims == ("test", "output")
    assert [*tree["output_unit"].values] == [UNITS[name] for name in NOISE]
    noise = dict(zip(names, per_objective(tree, tree["noise_sd"]), strict=True))
    assert noise["4 Hz / force"] == pytest.approx(NOISE["force"], rel=0.2)
    assert noise["4 Hz / acceleration"] == pytest.approx(NOISE["acceleration"], rel=0.2)
    assert np.isnan(tree["modes/m1"]["nrmsd"].sel(test="2 Hz", output="acceleration"))
    simulated = tree["modes/m1/prediction"]["4 Hz"].sel(output="acceleration").values
    residual = tree["observed_data"]["4 Hz"].sel(output="acceleration").values - simulated
    assert np.std(residual) == pytest.approx(NOISE["acceleration"], rel=0.1)
    page = (tmp_path / "run" / "report.html").read_text()
    assert all(name in page for name in names)
    assert "over time with the residual, per test: acceleration" in page
    assert main(["uncertainty", "run"]) == 0
    assert main(["export", "run", "--to", "toml"]) == 0
    capsys.readouterr()
    loop(tree, "4 Hz / force")
    errors(tree)


@pytest.mark.slow
def test_a_diagnosis_finds_the_output_that_has_the_gap(tmp_path, capsys):
    """A third harmonic in the quiet output, far below the noise of the loud one."""
    _, reference = write_rig(tmp_path)
    tests = campaign(MIXED)
    distorted = []
    for test in tests.measurements:
        angle = 2 * np.pi * test.experiment.frequency * test.time
        more = (
            {"acceleration": test.outputs["acceleration"] + 4 * NOISE["acceleration"] * np.sin(3 * angle)}
            if ("acceleration" in test.outputs)
            else {}
        )
        distorted.append(replace(test, outputs={**test.outputs, **more}))
    write_campaign(replace(tests, measurements=tuple(distorted)), tmp_path / "distorted.nc")
    command = ["diagnose", str(tmp_path / "distorted.nc"), "--model", reference, "--out", str(tmp_path / "found")]
    assert main(command) == 0
    assert "No gap" not in capsys.readouterr().out
    found = json.loads((tmp_path / "found" / "diagnosis.json").read_text())
    assert tuple(found["nrmsd_before"]) == build_problem(find_model(reference), tests).objective_names
    assert {entry["output"] for entry in found["where"]["residuals"]} == {"acceleration"}
    assert {entry["test"] for entry in found["where"]["residuals"]} == {"0.5 Hz", "1 Hz", "4 Hz"}


SHAKER = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class ShakenMass(Model):
    name = "shaken_mass"
    states = (Channel("x", "m"), Channel("v", "m/s"))
    inputs = (Channel("force", "N"),)
    outputs = (Channel("displacement", "m"), Channel("acceleration", "m/s^2"))
    parameters = (
        Parameter("m", "kg", 0.2, 5.0, 1.0, "log"),
        Parameter("d", "N s/m", 0.2, 20.0, 2.0, "log"),
        Parameter("k", "N/m", 20.0, 2e3, 200.0, "log"),
    )

    def equations(self, s):
        rate = (s.force - s.d * s.v - s.k * s.x) / s.m
        return Equations({"displacement": s.x, "acceleration": rate}, {"x": s.v, "v": rate})
"""


def shaken_mass(noise: dict[str, float]) -> Campaign:
    """Steady responses of m, d, k = 1.3, 8, 300 to sines of a force; half of the tests lack the acceleration."""
    rng, tests = np.random.default_rng(5), []
    for number, frequency in enumerate((0.8, 1.6, 2.4, 3.6)):
        time, w = np.arange(0, 4 + 8 / frequency, 0.01), 2 * np.pi * frequency
        rotation = 10 * np.exp(1j * w * time)
        moved = rotation / (300 - 1.3 * w**2 + 8j * w)
        outputs = {"displacement": moved.imag, "acceleration": (-(w**2) * moved).imag}
        kept = {
            name: values + noise[name] * rng.normal(size=len(time))
            for name, values in outputs.items()
            if name == "displacement" or number % 2
        }
        # the model starts at rest: in 4 s that has died away
        experiment = Experiment(
            f"{frequency:g} Hz", "sine", time, {"force": rotation.imag}, {}, frequency, 10.0, transient=4.0
        )
        units = {"force": "N", "displacement": "m", "acceleration": "m/s^2"}
        tests.append(Measurement(experiment, kept, {name: units[name] for name in ("force", *kept)}))
    return Campaign("shaker", "simulated", {}, tuple(tests))


@pytest.mark.slow
def test_a_shaken_mass_has_the_linearised_posterior(tmp_path):
    """Its displacement is known to 2 %, its acceleration to 0.1 % or so; the posterior is Fisher's at the truth."""
    noise, truth = {"displacement": 1e-3, "acceleration": 5e-3}, np.array([[1.3, 8.0, 300.0]])
    (tmp_path / "shaker.py").write_text(SHAKER)
    model, tests = find_model(f"{tmp_path / 'shaker.py'}:ShakenMass"), shaken_mass(noise)
    mode, *_ = find_modes(tests, model, Settings(jobs=1))
    problem, precision = build_problem(model, tests), np.zeros((3, 3))
    for experiment, (_, slopes) in zip(problem.experiments, problem.simulator.sensitivities(truth), strict=True):
        for y in experiment.fitted:
            own = slopes[0, experiment.weights[:, y] > 0, y] / [*noise.values()][y]
            precision += own.T @ own
    sd = np.sqrt(np.diag(np.linalg.inv(precision)))
    space = mode.sampled.space
    draws = space.from_unit(mode.chains.thinned().points.reshape(-1, 3))
    assert len(problem.objective_names) == 6
    assert np.abs((draws.mean(axis=0) - truth[0]) / sd).max() < 3
    assert np.abs(draws.std(axis=0) / sd - 1).max() < 0.25
