"""What the figures are drawn from, against known answers."""

from __future__ import annotations

import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy.signal import lfilter

from mofit.report.convergence import extract_traces
from mofit.report.corner import draw_corner, extract_corner, tick_texts
from mofit.report.errors import draw_errors, extract_errors
from mofit.report.marginals import extract_marginals
from mofit.report.overlay import Overlay, extract_overlays
from mofit.report.per_test import draw_leverage, extract_leverage, extract_per_test
from mofit.report.run import Mode, Run
from mofit.report.search import extract_front
from mofit.report.search_map import extract_search, pairs
from mofit.report.spectra import extract_spectra


@pytest.fixture(scope="module")
def run() -> Run:
    return Run(result_trees.make_result(synthetic_rigs.crowded(4), steps=40))


def replaced(run: Run, draws: np.ndarray) -> Mode:
    """The best mode with other draws, shape (chain, draw, parameter)."""
    node = run.tree["modes/m1"].copy(deep=True)
    names = run.best.parameters
    node["posterior"] = xr.DataTree(
        xr.Dataset({name: (("chain", "draw"), draws[..., k]) for k, name in enumerate(names)})
    )
    return Mode("m1", 0, node)


def box_draws(run: Run, unit: np.ndarray) -> np.ndarray:
    return run.space(run.best.parameters).from_unit(unit)


def test_marginals_cover_the_draws_and_stay_in_the_box(run) -> None:
    for marginal in extract_marginals(run):
        own = run.space([marginal.parameter])
        assert own.lower[0] <= marginal.edges[0] < marginal.edges[-1] <= own.upper[0]
        for name, density in marginal.density.items():
            width = np.diff(own.to_unit(marginal.edges[:, None])[:, 0])
            assert 0.99 <= np.sum(density * width) <= 1.0 + 1e-12
            low, high = marginal.place[name]
            assert 0 <= low < high <= 1


def test_corner_quantiles_and_its_picture(run) -> None:
    corner = extract_corner(run, run.best)
    draws = run.best.flat_draws
    np.testing.assert_allclose(corner.quantiles[1], np.median(draws, axis=0))
    axes = draw_corner(corner, "#0072B2", Figure().add_subplot())
    texts = [text.get_text() for text in axes.texts]
    assert f"{corner.correlation[1, 0]:+.2f}".replace("-", "−") in texts


@pytest.mark.parametrize(
    ("quantiles", "texts", "beyond_median"),
    [
        ((5559.2, 6663.8, 7859.0), ("5\u202f560", "7\u202f860"), False),
        ((3096.96, 3100.15, 3103.26), ("3\u202f097.0", "3\u202f103.3"), False),
        ((0.1296040, 0.1300048, 0.1303891), ("0.12960", "0.13039"), False),
        ((-1e-3, 0.0, 2.0), ("−0.00100", "2.00"), False),
        ((31e3 - 4e-4, 31e3, 31e3 + 5e-4), ("−0.00040", "0.00050"), True),
        ((1.23456e-6, 1.23457e-6, 1.23458e-6), ("−1.0×10⁻¹¹", "1.0×10⁻¹¹"), True),
        ((7.0, 7.0, 7.0), ("7.00", ""), False),
    ],
)
def test_corner_ticks_have_the_digits_that_tell_them_apart(quantiles, texts, beyond_median) -> None:
    assert tick_texts(*quantiles) == (texts, beyond_median)


@given(
    st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-12),
    st.floats(1e-12, 1e3),
)
def test_corner_ticks_differ(low, relative) -> None:
    width = relative * max(abs(low), 1e-6)
    (first, second), _ = tick_texts(low, low + 0.3 * width, low + width)
    assert first != second


def test_corner_regions_hold_their_share_of_the_draws(run) -> None:
    draws = box_draws(run, np.clip(0.5 + 0.05 * np.random.default_rng(5).normal(size=(4, 20_000, 4)), 0, 1))
    axes = draw_corner(extract_corner(run, replaced(run, draws)), "#000000", Figure().add_subplot())
    alpha = np.asarray(axes.images[0].get_array())[..., 3] / 255
    cell = alpha.shape[0] // 4
    density = alpha[cell : 2 * cell, :cell]
    areas = [np.count_nonzero(density >= level) for level in (0.2, 0.4, 0.8)]
    radii = np.sqrt(np.array(areas) / areas[0])
    expected = np.sqrt(np.log(1 - np.array([0.95, 0.68, 0.39])) / np.log(0.05))
    np.testing.assert_allclose(radii, expected, rtol=0.06)


@pytest.mark.parametrize("count", range(1, 11))
def test_every_parameter_appears_in_a_map(count) -> None:
    found = pairs(count)
    assert all(x != y for x, y in found)
    assert {k for pair in found for k in pair} == (set(range(count)) if count > 1 else set())


def test_search_is_ordered_with_the_best_last_and_without_failures(run) -> None:
    found = extract_search(run)
    assert np.isfinite(found.nrmsd).all()
    assert (np.diff(found.nrmsd) <= 0).all()
    assert len(found.points) == np.isfinite(run.tree["search/nrmsd"].values).all(axis=1).sum()
    assert len(found.archived) == run.tree["search"].sizes["archive"]


def test_parameters_held_during_the_search_are_left_out_of_its_maps(run) -> None:
    tree = run.tree.copy(deep=True)
    points = tree["search"].dataset["points"].copy(deep=True)
    points[:, 1] = 60.0
    tree["search"].dataset = tree["search"].to_dataset().assign(points=points)
    assert extract_search(Run(tree)).moved == [0, 2, 3]
    assert extract_search(run).moved == [0, 1, 2, 3]


def test_traces_of_thinned_chains_have_no_gaps(run) -> None:
    tree = run.tree.copy(deep=True)
    stats = tree["modes/m1/sample_stats"]
    stats.dataset = stats.to_dataset().assign(step=stats.dataset["step"] * 7)
    traces = extract_traces(Run(tree).best)
    assert np.isfinite(traces.middle).all()
    np.testing.assert_array_equal(traces.step, np.arange(40) * 7)


def test_front_lies_in_the_box(run) -> None:
    front = extract_front(run)
    assert ((front.place >= 0) & (front.place <= 1)).all()
    np.testing.assert_array_equal(front.noise_floor, run.of_tests("noise_floor"))


def test_minima_per_test_drop_tests_without_any() -> None:
    run = Run(result_trees.make_result(synthetic_rigs.tyre(), steps=20))
    found = extract_per_test(run)
    assert found.tests == [test for test, kind in zip(run.tests, run.excitations, strict=True) if kind == "sine"]
    np.testing.assert_array_equal(found.joint[:, 0], run.best.array("value"))
    assert found.value.shape == (9, 3, 3)


def test_errors_are_drawn_in_per_cent_over_frequency(run) -> None:
    errors = extract_errors(run)
    axes = draw_errors(errors, np.isfinite(errors.frequency), True, Figure().add_subplot())
    best = axes.lines[-1]
    np.testing.assert_allclose(best.get_ydata(), 100 * errors.models["m1"][np.argsort(errors.frequency)])
    assert axes.get_xscale() == "log"


def test_dropped_samples_are_not_shown(run) -> None:
    for overlay in extract_overlays(run, run.best):
        low, high = overlay.quantiles
        assert overlay.time[0] >= overlay.period - 1e-9
        assert overlay.measured.size == overlay.simulated.size == low.size == overlay.input.size
        assert (low <= high).all()
        assert overlay.last(1).draws.shape[1] == overlay.last(1).time.size


def overlay(excitation: str, time: np.ndarray, measured: np.ndarray, simulated: np.ndarray, **more) -> Overlay:
    empty = np.empty(0)
    settings = {"period": np.nan, "noise_sd": 1.0, "input": empty, "baseline": empty, "draws": np.empty((0, 0))} | more
    return Overlay(
        test="t", excitation=excitation, frequency=np.nan, noise_floor=0.0, input_name="", input_unit="1",
        output_name="y", output_unit="N", time=time, measured=measured, simulated=simulated, **settings,
    )  # fmt: skip


def test_spectrum_of_a_sine_and_of_white_noise() -> None:
    n = 4096
    time = np.arange(n) / 128.0
    sine = 3.0 * np.sin(2 * np.pi * 8.0 * time)
    noise = 0.5 * np.random.default_rng(6).normal(size=n)
    (spectrum,) = extract_spectra([overlay("multisine", time, sine + noise, sine, noise_sd=0.5)])
    line = np.argmax(spectrum.measured)
    assert spectrum.frequency[line] == pytest.approx(8.0)
    assert spectrum.measured[line] == pytest.approx(3.0, abs=0.05)
    np.testing.assert_allclose(spectrum.noise, 0.5 * np.sqrt(np.pi / n), rtol=0.1)
    assert spectrum.residual[:-1].mean() == pytest.approx(spectrum.noise.mean(), rel=0.05)
    assert not spectrum.repeats


def test_what_the_model_lacks_stands_above_the_spectrum_of_coloured_noise() -> None:
    n = 4096
    time = np.arange(n) / 128.0
    noise = lfilter([1.0], [1.0, -0.8], np.random.default_rng(7).normal(size=n))
    model, lacks = 300.0 * np.sin(2 * np.pi * time), np.sin(6 * np.pi * time)
    (spectrum,) = extract_spectra([overlay("sine", time, model + lacks + noise, model, period=1.0)])
    true = np.sqrt(np.pi / n) / np.abs(1 - 0.8 * np.exp(-2j * np.pi * spectrum.frequency / 128))
    assert spectrum.repeats
    assert np.mean((spectrum.low < true) & (true < spectrum.high)) > 0.8
    np.testing.assert_allclose(spectrum.noise, true, rtol=0.35)
    third = np.argmin(np.abs(spectrum.frequency - 3.0))
    assert spectrum.residual[third] > 2 * spectrum.high[third]
    assert np.mean(spectrum.residual > 3 * spectrum.high) < 0.01


@pytest.mark.parametrize(
    ("excitation", "period", "periods", "samples"),
    [
        ("sine", 0.5, 2, 101),
        ("sine", 0.5, 1, 51),
        ("sine", 100.0, 1, 1000),
        ("step", np.nan, 2, 1000),
        ("free", 0.5, 2, 400),
    ],
)
def test_the_part_of_a_record_that_is_drawn(excitation, period, periods, samples) -> None:
    time = np.arange(1000) / 100.0
    part = overlay(excitation, time, time, time, period=period).last(periods)
    assert part.time.size == part.measured.size == samples
    assert part.time[-1] == time[-1]


def test_a_run_out_at_the_end_is_not_taken_for_a_period() -> None:
    time = np.arange(1000) / 100.0
    stroke = np.sin(2 * np.pi * 2 * time) * np.where(time > 9.0, 0.4, 1.0)
    part = overlay("sine", time, stroke, stroke, input=stroke, period=0.5).last(2)
    assert part.time[-1] == pytest.approx(9.0, abs=0.02)
    assert np.ptp(part.input) == pytest.approx(2.0, rel=0.01)


def test_traces_are_quantiles_over_the_walkers_of_a_step(run) -> None:
    mode = run.best
    traces = extract_traces(mode)
    assert traces.middle.shape == (4, 40, 4)
    steps = run.tree["modes/m1/sample_stats/step"].values
    draws = mode.draws[2][steps[2] == 7]
    assert (np.sort(draws, axis=0)[[0, -1]][0] <= traces.low[2, 7]).all()
    np.testing.assert_array_equal(traces.middle[2, 7], np.sort(draws, axis=0)[round(0.5 * (len(draws) - 1))])


@pytest.mark.parametrize(
    ("verdict", "contraction", "bound", "grade"),
    [
        ("identified", 0.9, 0, "good"),
        ("identified", 0.9, 1, "bad"),
        ("weakly identified", 0.6, 0, "fair"),
        ("lower limit only", 0.9, 0, "fair"),
        ("not identifiable", 0.9, 0, "bad"),
        ("", 0.9, 0, "good"),
        ("", 0.2, 0, "bad"),
        ("", np.nan, 0, "unknown"),
    ],
)
def test_grades(run, verdict, contraction, bound, grade) -> None:
    node = run.tree["modes/m1"].copy(deep=True)
    values = {"verdict": verdict, "contraction": contraction, "at_bound": bound}
    node.dataset = node.to_dataset().assign({name: ("parameter", [value] * 4) for name, value in values.items()})
    assert Mode("m1", 0, node).grades == [grade] * 4


def test_leverage_shows_the_direction_that_lessens_the_error(run) -> None:
    tree = run.tree.copy()
    best = run.best
    assert extract_leverage(Run(tree)) is None
    change = np.zeros((len(run.tests), len(best.parameters)))
    change[0, 1], change[1, 0] = 0.08, -0.04
    node = tree["modes/m1"]
    node.dataset = node.to_dataset().assign(leverage=(("test", "parameter"), change))
    leverage = extract_leverage(Run(tree))
    assert leverage is not None
    axes = draw_leverage(leverage, Figure().add_subplot())
    written = {tuple(text.get_position()): text.get_text()[0] for text in axes.texts}
    assert written == {(0, 1): "↓", (1, 0): "↑"}
