"""Profiles and posteriors of expected data, against closed forms."""

import numpy as np
import pytest

from mofit.experimental_design.expected_profiles import (
    INTERVAL_WIDTH,
    SETTINGS,
    expected_data,
    expected_profiles,
    profile_interval,
)
from mofit.experimental_design.identifiability import bounded_sd, identifiability
from mofit.experimental_design.information import source_information
from mofit.experimental_design.noise_model import ChannelNoise, channel_noise, known_process
from mofit.experimental_design.simulated_identification import draw_noise, simulated_campaign, simulated_estimates
from mofit.experimental_design.sources import planned_source
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.parameters import Parameter, ParameterSpace
from mofit.sampling import SampleSettings
from mofit.simulation.virtual_rig.plan import Plan

TEST = {"kind": "sine", "sample_rate": "100 Hz", "amplitude": "10 mm", "periods": 12}


@pytest.fixture(scope="module")
def known():
    plan = Plan.model_validate({
        "title": "damper", "model": "maxwell_damper", "seed": 1, "noise": {"force": {"sd": "2 N"}},
        "parameters": {"c": "5 kN/m", "d": "200 N s/m", "c_M": "20 kN/m", "d_M": "1000 N s/m"},
        "tests": [{**TEST, "name": f"f{f}", "frequency": f"{f} Hz"} for f in (1, 3, 8)],
    })  # fmt: skip
    source = planned_source("damper", plan, find_model("maxwell_damper"))
    return source_information(source, source.values[None])


def test_profiles_of_sharp_parameters_have_the_width_of_the_local_spread(known) -> None:
    tests = ("f1", "f3", "f8")
    found = identifiability(known.precision(tests), known.samples, known.source.space)
    limits = expected_profiles(expected_data(known), tests, found)
    for k, own in enumerate(limits):
        assert own.closed == 2
        assert own.width / INTERVAL_WIDTH == pytest.approx(found.sd[0, k], rel=0.1)
        np.testing.assert_allclose(own.rise[np.argmin(np.abs(own.grid - known.samples[0, k]))], 0.0, atol=1e-3)


def test_one_sine_leaves_the_branch_open(known) -> None:
    tests = ("f3",)
    found = identifiability(known.precision(tests), known.samples, known.source.space)
    limits = expected_profiles(expected_data(known), tests, found)
    place = known.source.space.index("c")
    assert limits[place].closed < 2


def test_interval_of_a_parabola() -> None:
    grid = np.linspace(0, 1, 17)
    off = grid - 0.5
    space = ParameterSpace((Parameter("a", "m", 0.0, 10.0, 5.0),))
    parabola = profile_interval(space, grid, 0.5 * (off / 0.1) ** 2, 0.5)
    assert (parabola.low, parabola.high) == pytest.approx((5 - 0.5 * INTERVAL_WIDTH, 5 + 0.5 * INTERVAL_WIDTH))
    assert parabola.width == pytest.approx(0.1 * INTERVAL_WIDTH)
    assert profile_interval(space, grid, 0.1 * SETTINGS.rise * off**2, 0.5).closed == 0
    # where a refit fails, the value is excluded
    failed = profile_interval(space, grid, np.where(off > 0.15, np.nan, 0.0), 0.5)
    assert np.isnan(failed.low)
    assert failed.high == 6.875


def test_realised_noise_has_the_level_and_spectrum_asked_for() -> None:
    rng = np.random.default_rng(2)
    level = np.where(np.arange(512) < 256, 0.5, np.sqrt(1.75))
    spectrum = np.linspace(4.0, 1.0, 257)
    draws = np.array([draw_noise((known_process(level, spectrum),), rng) for _ in range(2000)])
    assert draws[:, :256].std() / draws[:, 256:].std() == pytest.approx(0.5 / np.sqrt(1.75), rel=0.02)
    found = np.mean(np.abs(np.fft.rfft(draws / level, axis=1)) ** 2, axis=0) / 512
    np.testing.assert_allclose(found[1:-1], spectrum[1:-1], rtol=0.15)


@pytest.mark.parametrize("truth", [ChannelNoise(sd=3.0), ChannelNoise(sd=1.0, coloured_sd=2.0, coefficient=0.9)])
def test_noise_of_other_tests_is_found_again(truth) -> None:
    parts = [truth(np.zeros(n), np.ones(n, dtype=bool)) for n in (1000, 2000)]
    whole = [known_process(np.ones(p[0].count), np.sum([own.spectrum for own in p], axis=0)) for p in parts]
    found = channel_noise(whole, [0.01, 0.01])
    assert found.sd == pytest.approx(truth.sd, rel=0.02)
    assert found.coloured_sd == pytest.approx(truth.coloured_sd, rel=0.02, abs=0.05)


def test_simulated_data_are_those_of_the_values_with_the_noise_stated(known) -> None:
    campaign = simulated_campaign(known, ("f1", "f8"), 3)
    assert campaign.tests == ("f1", "f8")
    for test, own in ((t, known.source.tests[i]) for t, i in (("f1", 0), ("f8", 2))):
        error = campaign[test].outputs["force"] - own.data.measured[:, 0]
        used = own.data.weights[:, 0] > 0
        assert error[used].std() == pytest.approx(2.0, rel=0.1)
    again = simulated_campaign(known, ("f1", "f8"), 3)
    np.testing.assert_array_equal(campaign["f1"].outputs["force"], again["f1"].outputs["force"])


def test_the_posterior_of_simulated_data_is_as_wide_as_expected(known) -> None:
    tests = ("f1", "f3", "f8")
    few = SampleSettings(ensembles=4, min_rounds=2, max_rounds=3, max_steps=60)
    names = ("c_M", "d_M")
    found = simulated_estimates(
        simulated_campaign(known, tests, 5), known.source.model, tests, Settings(seed=1, jobs=1, sampling=few), names
    )
    expected = identifiability(known.precision(tests), known.samples, known.source.space).sd[0] * known.derivative[0]
    for name in names:
        k = known.source.space.index(name)
        assert found[name].sd == pytest.approx(expected[k], rel=0.35)  # its noise is estimated from one record
        assert abs(found[name].mean - known.samples[0, k]) < 4 * expected[k]
        assert found[name].verdict == "identified"


def test_actual_estimates_scatter_as_predicted(known) -> None:
    """Linear estimates from many draws of the noise: the sandwich covariance."""
    tests = ("f1", "f3")
    own = [test for test in known.tests.main if test.test in tests]
    hessian = sum(test.hessian[0] for test in own)
    rng = np.random.default_rng(8)
    gradients = np.array([
        sum(test.weight[0] / test.ranges[0] ** 2 * test.jacobians[0][0].T @ draw_noise(test.noise[0][0], rng)
            for test in own)
        for _ in range(3000)
    ])  # fmt: skip
    actual = (np.linalg.solve(hessian, gradients.T) / known.derivative[0][:, None]).std(axis=1)
    free = bounded_sd(known.precision(tests)[0], np.full(6, -1e6), np.full(6, 1e6))
    np.testing.assert_allclose(actual, free, rtol=0.06)
