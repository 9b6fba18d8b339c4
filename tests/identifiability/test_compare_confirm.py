"""Profiles and posteriors of expected data, against closed forms."""

import numpy as np
import pytest

from mofit.identifiability.bounded import bounded_sd
from mofit.identifiability.comparison import Procedure
from mofit.identifiability.confirm import RISE, _crossing, expect, profiles
from mofit.identifiability.noise import ChannelNoise, channel_noise, process
from mofit.identifiability.posterior import posterior, realise, simulated_campaign
from mofit.identifiability.sources import planned_source
from mofit.identifiability.telling import tell
from mofit.identifiability.verdicts import spread
from mofit.library import find_model
from mofit.sample import SampleSettings
from mofit.settings import Settings
from mofit.simulate.plan import Plan

TEST = {"kind": "sine", "sample_rate": "100 Hz", "amplitude": "10 mm", "periods": 12}


@pytest.fixture(scope="module")
def told():
    plan = Plan.model_validate({
        "title": "damper", "model": "maxwell_damper", "seed": 1, "noise": {"force": {"sd": "2 N"}},
        "parameters": {"c": "5 kN/m", "d": "200 N s/m", "c_M": "20 kN/m", "d_M": "1000 N s/m"},
        "tests": [{**TEST, "name": f"f{f}", "frequency": f"{f} Hz"} for f in (1, 3, 8)],
    })  # fmt: skip
    source = planned_source("damper", plan, find_model("maxwell_damper"))
    return tell(source, source.values[None])


def test_profiles_of_sharp_parameters_have_the_width_of_the_local_spread(told) -> None:
    tests = ("f1", "f3", "f8")
    found = spread(told.precision(tests), told.values, told.source.space)
    limits = profiles(expect(told), tests, found)
    for k, own in enumerate(limits):
        assert own.closed == 2
        assert (own.high - own.low) / (2 * np.sqrt(2 * RISE)) == pytest.approx(found.sd[0, k], rel=0.1)
        np.testing.assert_allclose(own.rise[np.argmin(np.abs(own.grid - told.unit[0, k]))], 0.0, atol=1e-3)


def test_one_sine_leaves_the_branch_open(told) -> None:
    tests = ("f3",)
    found = spread(told.precision(tests), told.values, told.source.space)
    limits = profiles(expect(told), tests, found)
    place = told.source.space.index("c")
    assert limits[place].closed < 2


def test_crossing_of_a_parabola() -> None:
    grid = np.linspace(0, 1, 9)
    assert _crossing(grid, 0.5 * (grid / 0.2) ** 2) == pytest.approx(0.2 * np.sqrt(2 * RISE), rel=1e-9)
    assert np.isnan(_crossing(grid, 0.1 * grid))
    assert _crossing(grid, np.where(grid > 0.3, np.nan, 0.0)) == grid[3]


def test_realised_noise_has_the_level_and_spectrum_asked_for() -> None:
    rng = np.random.default_rng(2)
    level = np.where(np.arange(512) < 256, 0.5, np.sqrt(1.75))
    spectrum = np.linspace(4.0, 1.0, 257)
    draws = np.array([realise((process(level, spectrum),), rng) for _ in range(2000)])
    assert draws[:, :256].std() / draws[:, 256:].std() == pytest.approx(0.5 / np.sqrt(1.75), rel=0.02)
    found = np.mean(np.abs(np.fft.rfft(draws / level, axis=1)) ** 2, axis=0) / 512
    np.testing.assert_allclose(found[1:-1], spectrum[1:-1], rtol=0.15)


@pytest.mark.parametrize("truth", [ChannelNoise(sd=3.0), ChannelNoise(sd=1.0, coloured_sd=2.0, coefficient=0.9)])
def test_noise_of_other_tests_is_found_again(truth) -> None:
    parts = [truth(np.zeros(n), np.ones(n, dtype=bool)) for n in (1000, 2000)]
    whole = [process(np.ones(p[0].count), np.sum([own.spectrum for own in p], axis=0)) for p in parts]
    found = channel_noise(whole, [0.01, 0.01])
    assert found.sd == pytest.approx(truth.sd, rel=0.02)
    assert found.coloured_sd == pytest.approx(truth.coloured_sd, rel=0.02, abs=0.05)


def test_simulated_data_are_those_of_the_values_with_the_noise_stated(told) -> None:
    campaign = simulated_campaign(told, ("f1", "f8"), 3)
    assert campaign.tests == ("f1", "f8")
    for test, own in ((t, told.source.tests[i]) for t, i in (("f1", 0), ("f8", 2))):
        error = campaign[test].outputs["force"] - own.drive.measured[:, 0]
        judged = own.drive.weights[:, 0] > 0
        assert error[judged].std() == pytest.approx(2.0, rel=0.1)
    again = simulated_campaign(told, ("f1", "f8"), 3)
    np.testing.assert_array_equal(campaign["f1"].outputs["force"], again["f1"].outputs["force"])


def test_the_posterior_of_simulated_data_is_as_wide_as_expected(told) -> None:
    tests = ("f1", "f3", "f8")
    few = SampleSettings(ensembles=4, min_rounds=2, max_rounds=3, max_steps=60)
    names = ("c_M", "d_M")
    found = posterior(
        simulated_campaign(told, tests, 5), told.source.model, tests, Settings(seed=1, jobs=1, sampling=few), names
    )
    expected = spread(told.precision(tests), told.values, told.source.space).sd[0] * told.stretch[0]
    for name in names:
        k = told.source.space.index(name)
        assert found[name].sd == pytest.approx(expected[k], rel=0.35)  # its noise is estimated from one record
        assert abs(found[name].mean - told.values[0, k]) < 4 * expected[k]
        assert found[name].verdict == "identified"


def test_actual_estimates_scatter_as_predicted(told) -> None:
    """Linear estimates from many draws of the noise: the sandwich covariance."""
    procedure = Procedure("two", 0, ("f1", "f3"))
    shown = [test for test in told.shown if test.test in procedure.tests]
    stretch = told.stretch[0]
    normal = sum(test.normal[0] for test in shown)
    rng = np.random.default_rng(8)
    slopes = np.array([
        sum(test._weight[0] / test.ranges[0] ** 2 * test.slopes[0][0].T @ realise(test.noise[0][0], rng)
            for test in shown)
        for _ in range(3000)
    ])  # fmt: skip
    actual = (np.linalg.solve(normal, slopes.T) / stretch[:, None]).std(axis=1)
    free = bounded_sd(told.precision(procedure.tests)[0], np.full(6, -1e6), np.full(6, 1e6))
    np.testing.assert_allclose(actual, free, rtol=0.06)
