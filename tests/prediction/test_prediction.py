"""Predictions against known answers: parts of the band, coverage, modes, scoped parameters, tests held out."""

import json

import numpy as np
import pytest
import result_trees
import straight_line
import synthetic_rigs
import two_outputs
import xarray as xr
from scipy.stats import norm

import mofit
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.prediction.band import mixture_quantile
from mofit.prediction.draws import posterior_draws
from mofit.prediction.scoped import ScopedValue
from mofit.prediction.transfer import transferred
from mofit.results import prediction_rows

NINETY = 1.6449


@pytest.fixture(scope="module", params=["sampled", "Laplace"])
def line(request, tmp_path_factory):
    """Result of a straight line through one sine; its posterior is Gaussian but for the level of the noise."""
    folder = tmp_path_factory.mktemp("line") / "run"
    settings = Settings(jobs=1, sample=request.param == "sampled", evaluations=200)
    records = straight_line.campaign(straight_line.sine_test())
    _, tree = mofit.identify(records, straight_line.StraightLine(), settings, out=folder)
    return request.param, tree


def test_parts_of_the_band_are_those_of_linear_regression(line):
    spread, tree = line
    far = straight_line.sine_test("far", size=30.0, periods=3)
    found = mofit.predict(tree, straight_line.campaign(far), model=straight_line.StraightLine())
    used = straight_line.sine_test().time >= 1.0  # a fit drops the first period
    x = straight_line.sine_test().experiment.inputs["displacement"][used]
    columns = np.stack([x, np.ones_like(x)], axis=1)
    covariance = straight_line.NOISE**2 * np.linalg.inv(columns.T @ columns)
    rows = np.stack([far.experiment.inputs["displacement"], np.ones(len(far.time))], axis=1)
    expected = np.sqrt(np.einsum("ni,ij,nj->n", rows, covariance, rows))
    (table,) = prediction_rows(found)
    assert found.attrs["spread"] == spread
    assert table["parameter_sd"] == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.15)
    assert table["noise_sd"] == pytest.approx(straight_line.NOISE, rel=0.05)
    assert table["model_error"] < 0.5 * straight_line.NOISE * 30
    own = found["tests/far"]
    width = (own["parameter_high"] - own["parameter_low"]).values
    assert np.mean(width) == pytest.approx(2 * NINETY * np.mean(expected), rel=0.15)
    total = np.sqrt(expected**2 + table["noise_sd"] ** 2 + table["model_error"] ** 2)
    assert np.mean((own["high"] - own["low"]).values) == pytest.approx(2 * NINETY * np.mean(total), rel=0.05)


def test_coverage_is_ninety_percent_with_fresh_noise(line):
    _, tree = line
    records = [straight_line.sine_test(f"t{seed}", periods=40, seed=100 + seed) for seed in range(10)]
    found = mofit.predict(tree, straight_line.campaign(*records), model=straight_line.StraightLine())
    assert np.mean(found["coverage"]) == pytest.approx(0.9, abs=0.012)
    assert np.mean(found["rms"]) == pytest.approx(straight_line.NOISE, rel=0.02)


def test_a_record_without_output_has_a_band_and_no_errors(line):
    _, tree = line
    whole = straight_line.sine_test("far", size=3.0)
    records = straight_line.campaign(whole, straight_line.unmeasured(straight_line.sine_test("blind", size=3.0)))
    found = mofit.predict(tree, records, model=straight_line.StraightLine())
    seen, blind = prediction_rows(found)
    assert blind["nrmsd"] is blind["rms"] is blind["coverage"] is blind["scored_from"] is None
    assert blind["parameter_sd"] == seen["parameter_sd"]
    np.testing.assert_array_equal(found["tests/blind/high"], found["tests/far/high"])
    assert np.isnan(found["tests/blind/measured"]).all()


def test_a_test_alone_is_predicted_as_among_others(line):
    _, tree = line
    records = straight_line.campaign(*(straight_line.sine_test(f"t{k}", size=1.0 + k) for k in range(3)))
    together, alone = (
        mofit.predict(tree, records, model=straight_line.StraightLine(), tests=tests) for tests in ((), ("t1",))
    )
    assert prediction_rows(together)[1] == prediction_rows(alone)[0]
    xr.testing.assert_identical(*(found["tests/t1"].to_dataset(inherit=False) for found in (together, alone)))


def test_another_model_is_refused(line):
    _, tree = line
    other = straight_line.StraightLine()
    other.equations = lambda s: straight_line.Equations(outputs={"force": 1.01 * s.k * s.displacement + s.b})
    with pytest.raises(InputError, match="equations are not those"):
        mofit.predict(tree, straight_line.campaign(straight_line.sine_test()), model=other)


def test_every_lacking_channel_is_named(line):
    _, tree = line
    time = np.arange(100) / 100
    tests = [
        mofit.Measurement(mofit.Experiment(name, "free", time, {"velocity": time}), {}, {"velocity": "m/s"})
        for name in ("one", "two")
    ]
    with pytest.raises(InputError) as caught:
        mofit.predict(tree, straight_line.campaign(*tests), model=straight_line.StraightLine())
    assert [issue.where for issue in caught.value.issues] == ["test 'one'", "test 'two'"]
    assert "displacement" in caught.value.issues[0].message


def test_quantiles_of_a_mixture():
    assert mixture_quantile(np.zeros((1, 2)), 2.0, 0.95) == pytest.approx([2 * NINETY] * 2, rel=1e-4)
    apart = np.array([[-100.0], [100.0], [100.0], [100.0]])  # 5 % are a fifth of the lower mode
    assert mixture_quantile(apart, 1.0, 0.05) == pytest.approx([-100 + norm.ppf(0.2)], abs=1e-3)
    many = np.random.default_rng(0).normal(0, 3.0, (4000, 1))
    assert mixture_quantile(many, 4.0, 0.95) == pytest.approx([5 * NINETY], rel=0.03)
    assert mixture_quantile(many, 0.0, 0.95) == pytest.approx(np.quantile(many, 0.95))


def test_draws_come_from_all_modes_by_their_probability():
    tree = result_trees.make_result(synthetic_rigs.oscillator(), clusters=2, steps=60)
    draws = posterior_draws(tree, 200, 0)
    first = np.asarray(tree["modes/m1/posterior"].to_dataset().to_dataarray()).ravel()
    share = np.mean(np.isin(draws[:, 0], first))
    assert share == pytest.approx(tree["modes/m1"].attrs["probability"], abs=0.006)
    np.testing.assert_array_equal(draws, posterior_draws(tree, 200, 0))


@pytest.mark.parametrize(("sd", "kind"), [([1.0, 1.1, 1.0], "units"), ([1.0, 2.1, 8.0], "share")])
def test_noise_transfers_in_the_form_that_the_tests_share(sd, kind):
    outputs = (mofit.Channel("force", "N"),)
    labels = {"test": ["a", "b", "c"]}
    root = xr.Dataset({"noise_sd": ("test", sd), "range": ("test", [10.0, 20.0, 80.0]), "gap": 0.02}, labels)
    tree = xr.DataTree.from_dict({"/": root, "/modes/m1": xr.Dataset({"nrmsd": ("test", [0.2] * 3)}, labels)})
    (noise,) = transferred(tree, outputs).noise
    assert noise.kind == kind
    assert noise.sd(40.0) == pytest.approx(1.0 if kind == "units" else 4.0, rel=0.1)


def test_noise_is_no_more_than_the_residual():
    labels = {"test": ["a", "b"]}
    root = xr.Dataset({"noise_sd": ("test", [5.0, 5.0]), "range": ("test", [10.0, 10.0]), "gap": 0.0}, labels)
    tree = xr.DataTree.from_dict({"/": root, "/modes/m1": xr.Dataset({"nrmsd": ("test", [0.1, 0.1])}, labels)})
    (noise,) = transferred(tree, (mofit.Channel("force", "N"),)).noise
    assert noise.value == pytest.approx(1.0)


@pytest.fixture(scope="module")
def leaning(tmp_path_factory):
    """Result of tests under two loads, with an offset per test and a slope per load."""
    tests = [
        straight_line.leaning_test(f"t{n}", float(n % 2), b=n - 1.5, c=(1.0, -2.0)[n % 2], seed=n) for n in range(4)
    ]
    settings = Settings(jobs=1, sample=False, evaluations=200)
    folder = tmp_path_factory.mktemp("leaning") / "run"
    return mofit.identify(straight_line.campaign(*tests), straight_line.Leaning(), settings, out=folder)[1]


def without_scoped(tree: xr.DataTree) -> xr.DataTree:
    """The result as of a run that tells nothing of its scoped parameters."""
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree if node.name != "scoped"}
    return xr.DataTree.from_dict(groups)


def test_scoped_parameters_are_fitted_to_a_measured_record(leaning):
    new = straight_line.leaning_test("new", 3.0, b=4.0, c=0.7, seed=9)
    found = mofit.predict(leaning, straight_line.campaign(new), model=straight_line.Leaning())
    (row,) = prediction_rows(found)
    assert row["scoped"] == {"b": "fitted", "c": "fitted"}
    # linear regression: offset and slope of the lever from this record's 1,000 samples, k from four times as many
    assert row["parameter_sd"] == pytest.approx(straight_line.NOISE * np.sqrt(2 / 1000 + 1 / 4000), rel=0.12)
    assert row["rms"] == pytest.approx(straight_line.NOISE, rel=0.05)
    assert row["coverage"] == pytest.approx(0.9, abs=0.04)


def test_scoped_parameters_without_a_measured_output(leaning):
    blind = straight_line.unmeasured(straight_line.leaning_test("blind", 1.0, b=4.0, c=0.7))
    records, model = straight_line.campaign(blind), straight_line.Leaning()
    nominal = mofit.predict(without_scoped(leaning), records, model=model)
    assert json.loads(nominal.attrs["scoped"])["blind"] == {"b": "nominal", "c": "nominal"}
    known = mofit.predict(leaning, records, model=model)
    assert json.loads(known.attrs["scoped"])["blind"] == {"b": "mean", "c": "identified"}
    x, z = (blind.experiment.inputs[name] for name in ("displacement", "lever"))
    # offsets of -1.5 to 1.5 have a standard deviation of 1.29; the median of 200 draws lies within 0.1 of their mean
    assert known["tests/blind/median"].values == pytest.approx(2.0 * x - 2.0 * z, abs=0.4)
    assert prediction_rows(known)[0]["parameter_sd"] == pytest.approx(1.29, rel=0.15)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_pooled_parameter_is_drawn_from_its_normal(scale):
    parameter = mofit.Parameter("b", "N", 0.01, 1e4, 1.0, scale, per="test", pooled=True)
    known = {"b_mean": np.full(4000, 10.0), "b_spread": np.full(4000, 0.2)}
    draws = ScopedValue(parameter, "pooled", np.nan, np.nan).draws(known, 4000, np.random.default_rng(0))
    values = np.log(draws / 10) if scale == "log" else draws - 10
    assert values.mean() == pytest.approx(0.0, abs=0.01)
    assert values.std() == pytest.approx(0.2, rel=0.03)


def test_a_condition_that_was_identified_is_not_fitted_again(leaning):
    new = straight_line.leaning_test("new", 1.0, b=4.0, c=-2.0, seed=9)
    found = mofit.predict(leaning, straight_line.campaign(new), model=straight_line.Leaning())
    (row,) = prediction_rows(found)
    assert row["scoped"] == {"b": "fitted", "c": "identified"}
    assert row["rms"] == pytest.approx(straight_line.NOISE, rel=0.05)


def test_several_outputs_have_bands_of_their_own(tmp_path):
    path, model = two_outputs.write_rig(tmp_path)
    settings = Settings(jobs=1, sample=False, evaluations=200)
    folder, tree = mofit.identify(path, model, settings, hold_out="4 Hz", out=tmp_path / "run")
    mine = {row["output"]: row for row in prediction_rows(tree["held_out"]) if row["test"] == "4 Hz"}
    for output, sd in two_outputs.NOISE.items():
        assert mine[output]["noise_sd"] == pytest.approx(sd, rel=0.2)
        assert mine[output]["unit"] == two_outputs.UNITS[output]
        assert mine[output]["coverage"] == pytest.approx(0.9, abs=0.06)
    assert tree["held_out/tests/4 Hz/median"].dims == ("time", "output")
    again = mofit.predict(folder, path, model=model, tests=["4 Hz"])
    kept = mofit.open(folder)["held_out/tests/4 Hz"]
    xr.testing.assert_identical(*(node.to_dataset(inherit=False) for node in (again["tests/4 Hz"], kept)))
