"""The numbers of the uncertainty page against known answers."""

from __future__ import annotations

import arviz_stats
import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from mofit.report.directions import correlation, direction_texts, directions_of, strong_pairs
from mofit.report.estimates import Estimate
from mofit.report.per_test import extract_per_test
from mofit.report.run import Mode, Run
from mofit.report.uncertainty.fundamental import extract_errors, extract_fundamental, lines
from mofit.report.uncertainty.homogeneity import extract_homogeneity
from mofit.report.uncertainty.loops import predictions
from mofit.report.uncertainty.marginals import PROFILE_RISE, extract_comparisons, profile_interval
from mofit.report.uncertainty.table import extract_rows, sentence
from mofit.results import cochran


@pytest.fixture(scope="module")
def run() -> Run:
    return Run(result_trees.make_result(synthetic_rigs.crowded(4), steps=40))


@pytest.fixture(scope="module")
def tyre() -> Run:
    return Run(result_trees.make_result(synthetic_rigs.tyre(), steps=40))


def with_draws(run: Run, unit: np.ndarray) -> Mode:
    """The best mode with draws at these places of the box, (chain, draw, parameter), and their mean and sd."""
    names = run.best.parameters
    values = run.space(names).from_unit(unit)
    node = run.tree["modes/m1"].copy(deep=True)
    node["posterior"] = xr.DataTree(xr.Dataset({n: (("chain", "draw"), values[..., k]) for k, n in enumerate(names)}))
    flat = values.reshape(-1, len(names))
    node.dataset = node.to_dataset().assign(mean=("parameter", flat.mean(axis=0)), sd=("parameter", flat.std(axis=0)))
    return Mode("m1", 0, node)


def test_the_table_shows_what_arviz_says(run) -> None:
    for mode in run.modes:
        table = arviz_stats.summary(mode.node["posterior"].to_dataset(), round_to="none", ci_kind="eti", ci_prob=0.9)
        low, high = sorted((c for c in table.columns if c.startswith("eti")), key=lambda c: table[c].iloc[0])
        for shown_row, (name, row) in zip(extract_rows(run, mode), table.iterrows(), strict=True):
            e = shown_row.estimate
            assert e.parameter == name
            shown, expected = [e.mean, e.sd, e.q05, e.q95], [row["mean"], row["sd"], row[low], row[high]]
            np.testing.assert_allclose(shown, expected, rtol=1e-9)


def test_the_space_of_a_run_is_that_of_its_parameters(run) -> None:
    space = run.space(["v_0", "c"])
    assert space.names == ("v_0", "c")
    assert [parameter.scale for parameter in space.parameters] == ["log", "linear"]
    assert space.units == (run.unit("v_0"), run.unit("c"))


def estimate(**changes) -> Estimate:
    values = {
        "mode": "m1", "parameter": "d_M", "unit": "N s/m", "value": 100.0, "mean": 100.0, "sd": 2.0, "q05": 96.7,
        "q50": 100.0, "q95": 103.3, "noise_sd": 1.0, "contraction": 0.98, "at_bound": 0, "verdict": "identified",
        "grade": "good",
    }  # fmt: skip
    return Estimate(**(values | changes))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, "identified to ± 2.0"),
        ({"mean": 1.0, "value": 1.0}, "zero is not excluded"),
        ({"verdict": "lower limit only"}, "only a lower limit: above 96.7"),
        ({"verdict": "upper limit only"}, "only an upper limit: below 103.3"),
        ({"verdict": "not identifiable", "contraction": 0.02}, "the posterior equals the prior"),
        ({"verdict": "not identifiable", "contraction": 0.3}, "reaches both bounds"),
        ({"verdict": "weakly identified", "contraction": 0.4}, "a range, not a value, 60"),
        ({"at_bound": 1}, "at its upper bound"),
        ({"at_bound": -1}, "at its lower bound"),
        ({"value": 103.0}, "its mean is 1.5 sd from the MAP estimate"),
        ({"sd": np.nan, "verdict": ""}, "not sampled"),
    ],
)
def test_sentences(changes, expected) -> None:
    text = sentence(estimate(**changes), [], show=lambda name: name)
    assert text.startswith("d_M: ")
    assert expected in text


@pytest.mark.parametrize(
    ("earlier", "expected"), [(2.0, "the other tests add nothing"), (4.0, "50"), (1.0, "2.0× that of")]
)
def test_a_sentence_tells_what_the_calibration_stage_knew(earlier, expected) -> None:
    assert expected in sentence(estimate(), [], earlier)


def test_a_flat_direction_is_named_in_physical_terms(run) -> None:
    rng = np.random.default_rng(3)
    along = rng.uniform(-0.35, 0.35, size=(4, 5000))
    unit = 0.5 + 0.01 * rng.normal(size=(4, 5000, 4))
    unit[..., 0] += along
    unit[..., 2] -= along
    mode = with_draws(run, unit)
    first, *others = directions_of(run, mode)
    assert first.flat
    assert not any(direction.flat for direction in others)
    assert first.width == pytest.approx(0.7 * np.sqrt(2), rel=0.02)
    # c runs from 0 to 5000 N/m around 2500: a standard deviation of 0.7/sqrt(12) of the box is 0.404 of its value;
    # v_0 is searched by its logarithm over 1e-4 to 1
    change = {c.parameter: c for c in first.changes}
    assert set(change) == {"c", "v_0"}
    up = np.sign(change["c"].relative)
    assert change["c"].absolute == pytest.approx(up * 0.7 / np.sqrt(12) * 5000, rel=0.02)
    assert change["c"].relative == pytest.approx(up * 0.404, rel=0.03)
    assert change["v_0"].relative == pytest.approx(1e4 ** (-up * 0.7 / np.sqrt(12)) - 1, rel=0.06)
    (pair,) = strong_pairs(run, mode)
    assert (pair.first, pair.second) == ("c", "v_0")
    assert pair.correlation < -0.99
    (text,) = direction_texts([first, *others])
    assert text.startswith("<b>Not identifiable:</b>")
    assert "compensate each other (correlation −1.0" in pair.text


def test_correlation_and_directions_of_known_draws(run) -> None:
    rng = np.random.default_rng(2)
    normal = rng.normal(size=(4, 20_000, 4))
    normal[..., 1] = -0.9 * normal[..., 0] + np.sqrt(1 - 0.81) * normal[..., 1]
    matrix = correlation(run, with_draws(run, 0.5 + 0.02 * normal))
    assert matrix[0, 1] == pytest.approx(-0.9, abs=0.01)
    assert abs(matrix[2, 3]) < 0.02
    prior = with_draws(run, rng.uniform(size=(4, 5000, 4)))
    np.testing.assert_allclose([d.width for d in directions_of(run, prior)], 1.0, atol=0.05)


def test_a_narrow_posterior_has_no_flat_direction(run) -> None:
    unit = 0.5 + 0.01 * np.random.default_rng(4).normal(size=(4, 5000, 4))
    mode = with_draws(run, unit)
    found = directions_of(run, mode)
    np.testing.assert_allclose([d.width for d in found], 0.01 * np.sqrt(12), rtol=0.05)
    assert "identify every direction" in direction_texts(found)[0]


def test_the_ratio_of_a_pair_is_the_slope_of_its_ridge(run) -> None:
    rng = np.random.default_rng(5)
    space = run.space(run.best.parameters)
    unit = 0.5 + 0.001 * rng.normal(size=(4, 5000, 4))
    t = 0.02 * rng.normal(size=(4, 5000))
    values = space.from_unit(unit)
    values[..., 0] *= 1 + t
    values[..., 1] *= 1 - 3 * t
    (pair,) = strong_pairs(run, with_draws(run, space.to_unit(values)))
    assert pair.ratio == pytest.approx(-3, rel=0.02)


def test_marginal_density_is_relative_to_the_prior(run) -> None:
    unit = np.random.default_rng(6).uniform(size=(4, 20_000, 4))
    mode = with_draws(run, unit)
    for found in extract_comparisons(run, mode):
        np.testing.assert_allclose(found.marginal.density["m1"], 1.0, atol=0.12)
        assert found.marginal.log == (found.marginal.parameter == "v_0")
        assert found.profile_value.size == 0
        assert np.isnan(found.profile).all()


def test_profile_interval_of_a_parabola_and_of_an_open_one() -> None:
    x = np.linspace(-3, 3, 13)
    np.testing.assert_allclose(profile_interval(x, 0.5 * x**2), [-1.6449, 1.6449], atol=1e-4)
    assert pytest.approx(chi2.ppf(0.9, 1) / 2, abs=1e-4) == PROFILE_RISE
    low, high = profile_interval(x, np.where(x < 0, 0.01, 0.5) * x**2)
    assert low == -np.inf
    assert high == pytest.approx(1.6449, abs=1e-4)


def test_the_profile_of_the_tree_is_shown_in_its_unit(run) -> None:
    tree = run.tree.copy(deep=True)
    place = np.linspace(0.4, 0.6, 5)
    names = run.best.parameters
    value = np.stack([run.space([name]).from_unit(place[:, None])[:, 0] for name in names])
    nll = np.tile(0.5 * ((place - 0.5) / 0.03) ** 2, (4, 1))
    nll[1, 0] = np.nan
    dims = ("parameter", "point")
    tree["modes/m1/profile"] = xr.DataTree(
        xr.Dataset({"value": (dims, value), "neg_log_posterior": (dims, nll)}, {"parameter": names})
    )
    found = extract_comparisons(Run(tree), Run(tree).best)
    np.testing.assert_array_equal(found[0].profile_value, value[0])
    np.testing.assert_array_equal(found[1].profile_value, value[1, 1:])
    assert found[2].profile[0] < value[2, 2] < found[2].profile[1]
    assert found[0].marginal.edges[0] <= value[0, 0]
    assert found[0].marginal.edges[-1] >= value[0, -1]


def test_cochran_by_hand() -> None:
    # weights 1, 4, 4 (sum 9); mean (10 + 48 + 56) / 9 = 38/3; squares 64/9 + 4 * 4/9 + 4 * 16/9 = 16
    mean, sd, q, p, i_squared = cochran(np.array([10.0, 12.0, 14.0]), np.array([1.0, 0.5, 0.5]))
    assert mean == pytest.approx(38 / 3)
    assert sd == pytest.approx(1 / 3)
    assert q == pytest.approx(16.0)
    assert p == pytest.approx(np.exp(-8.0))  # chi² with two degrees of freedom
    assert i_squared == pytest.approx(14 / 16)


def test_cochran_of_few() -> None:
    assert np.isnan(cochran(np.empty(0), np.empty(0))).all()
    mean, sd, q, p, i_squared = cochran(np.array([3.0]), np.array([0.5]))
    assert (mean, sd, q) == (3.0, 0.5, 0.0)
    assert np.isnan([p, i_squared]).all()


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0.1, 3)), min_size=2, max_size=8), st.floats(0.1, 10))
def test_cochran_does_not_depend_on_the_unit(rows, factor) -> None:
    x, sd = np.array(rows).T
    _, _, q, p, i_squared = cochran(x, sd)
    _, _, other_q, other_p, other_i = cochran(factor * x + 7, factor * sd)
    assert other_q == pytest.approx(q, rel=1e-6, abs=1e-9)
    assert other_p == pytest.approx(p, rel=1e-6, abs=1e-9)
    assert 0 <= i_squared <= 1
    assert other_i == pytest.approx(i_squared, abs=1e-6)


def test_estimates_at_a_bound_or_as_wide_as_the_box_are_left_out(tyre) -> None:
    tree = tyre.tree.copy(deep=True)
    node = tree["per_frequency"]
    value, sd = node.dataset["value"].copy(deep=True), node.dataset["sd"].copy(deep=True)
    sine = [k for k, kind in enumerate(tyre.excitations) if kind == "sine"]
    truth = np.array([281.0, 19_910.0, 7_535.0])
    value[sine, 0] = truth * 1.05 ** np.array([1.0, -1, 0.5, -0.5, 0, 0.3, -0.3, 0.1, -0.1])[:, None]
    sd[sine, 0] = 0.1 * truth
    value[sine[0], 0, 0], value[sine[1], 0, 1] = 2e3, 1e3
    sd[sine[2], 0, 2] = 8e3
    value[sine, 0, 0] = np.where(np.arange(9) == 0, 2e3, truth[0] * np.linspace(0.4, 2.5, 9))
    node.dataset = node.to_dataset().assign(value=value, sd=sd)
    changed = Run(tree)
    first, second, third = extract_homogeneity(changed, extract_per_test(changed))
    assert first.at_bound == ["sine_0.25Hz"]
    assert second.at_bound == ["sine_0.5Hz"]
    assert third.wide == ["sine_1Hz"]
    assert [len(r.used) for r in (first, second, third)] == [8, 8, 8]
    assert (first.agree, second.agree, third.agree) == (False, True, True)
    assert first.drift == pytest.approx(1.0)
    assert third.pooled == pytest.approx(truth[2], rel=0.02)
    assert third.pooled_sd == pytest.approx(0.1 * truth[2] / np.sqrt(8), rel=0.1)
    text = first.text
    assert "disagree beyond their standard deviations" in text
    assert "rise with frequency" in text
    assert "at a bound: sine_0.25Hz" in text
    assert "about as wide as the prior box: sine_1Hz" in third.text


def test_tests_that_agree_with_one_another_but_not_with_all_together_disagree(tyre) -> None:
    """Each alone takes the damping for a branch's: pooled 621 ± 17, all together near 281."""
    tree = tyre.tree.copy(deep=True)
    node = tree["per_frequency"]
    value, sd = node.dataset["value"].copy(deep=True), node.dataset["sd"].copy(deep=True)
    sine = [k for k, kind in enumerate(tyre.excitations) if kind == "sine"]
    value[sine, 0, 0], sd[sine, 0, 0] = 621.0, 17.0 * np.sqrt(len(sine))
    node.dataset = node.to_dataset().assign(value=value, sd=sd)
    changed = Run(tree)
    first, *_ = extract_homogeneity(changed, extract_per_test(changed))
    assert (first.pooled, first.pooled_sd) == pytest.approx((621.0, 17.0))
    assert first.p > 0.99
    assert first.agree is False
    assert "agree with one another, but lie" in first.text


def test_amplitude_and_phase_of_a_sine() -> None:
    time = np.arange(0, 3.0, 0.01)
    signals = np.stack([2.5 * np.cos(2 * np.pi * time - 0.4) + 3, np.sin(2 * np.pi * time)])
    first, second = lines(time, signals, 1.0)
    assert first == pytest.approx(2.5 * np.exp(-0.4j))
    assert second == pytest.approx(-1j)


def test_fundamental_is_that_of_the_tyres_stiffness(tyre) -> None:
    found_tests = predictions(tyre)
    found = extract_fundamental(found_tests)
    assert found.tests == [test for test, kind in zip(tyre.tests, tyre.excitations, strict=True) if kind == "sine"]
    f = found.frequency
    gain = np.array([synthetic_rigs.maxwell_gain(x, 281.0, 19_910.0, 7_535.0) for x in f]) * 0.5 / (1 + 0.25j * f)
    amplitude = np.abs(gain) * np.radians(2)
    assert (np.abs(found.amplitude.value - amplitude) < 3 * found.amplitude.error).all()
    assert (np.abs(found.phase.value - np.degrees(np.angle(gain))) < 3 * found.phase.error).all()
    assert (np.diff(found.amplitude.draws, axis=1) > 0).all()
    # white noise of 1 % of the amplitude over five periods, known from their scatter
    samples = np.array([p.time.size for p in found_tests if p.test in found.tests])
    expected = 1.645 * 0.01 * amplitude * np.sqrt(2 / samples)
    assert np.median(found.amplitude.error / expected) == pytest.approx(1.1, abs=0.25)


def test_errors_of_the_draws_and_samples_inside_the_band(tyre) -> None:
    found_tests = predictions(tyre)
    errors = extract_errors(found_tests)
    assert (np.diff(errors.nrmsd, axis=1) >= 0).all()
    prediction = found_tests[-1]
    measured = prediction.measured
    every = [np.sqrt(np.mean((draw - measured) ** 2)) / np.ptp(measured) for draw in prediction.draws]
    np.testing.assert_allclose(errors.nrmsd[-1], np.quantile(every, [0.05, 0.5, 0.95]))
    samples = sum(p.time.size for p in found_tests)
    inside = sum(p.inside * p.time.size for p in found_tests) / samples
    assert inside == pytest.approx(0.9, abs=0.03)
