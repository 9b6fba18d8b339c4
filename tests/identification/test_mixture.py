"""Two solutions that the data can hardly tell apart: the run also holds both together, each with its weight."""

import numpy as np
import pytest
from labels import unlabelled

import mofit
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter
from mofit.report import build_uncertainty
from mofit.results.io import check_result


class InclinedSpring(Model):
    """F = k x + h phi^2 x^3 + e phi x^2: the sign of phi is next to invisible."""

    name = "inclined_spring"
    parameters = (
        Parameter("k", "N/m", 0.5, 2.0, 1.0, description="stiffness"),
        Parameter("phi", "rad", -1.0, 1.0, 0.1, description="inclination"),
    )
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        x = s.displacement
        return Equations(outputs={"force": s.k * x + 2.0 * s.phi**2 * x**3 + 0.002 * s.phi * x**2})


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    rng = np.random.default_rng(8)
    tests = []
    for frequency in (0.7, 1.5):
        time = np.arange(0, 8 / frequency, 0.01)
        x = np.sin(2 * np.pi * frequency * time)
        force = 1.2 * x + 2.0 * 0.4**2 * x**3 + 0.002 * 0.4 * x**2 + 0.05 * rng.normal(size=len(x))
        experiment = Experiment(f"sine_{frequency:g}Hz", "sine", time, {"displacement": x}, {}, frequency, 1.0)
        tests.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    campaign = Campaign("spring", "simulated", {}, tuple(tests))
    folder = tmp_path_factory.mktemp("runs") / "spring"
    return mofit.identify(campaign, InclinedSpring(), Settings(seed=1, jobs=1), out=folder)


def test_summary_is_that_of_the_weighted_solutions(run):
    _, tree = run
    clusters = tree["modes"].children.values()
    weights, means, sds = (
        np.array([values(c) for c in clusters])
        for values in (lambda c: c.attrs["probability"], lambda c: c["mean"].values, lambda c: c["sd"].values)
    )
    assert len(weights) == 2
    mean = weights @ means
    np.testing.assert_allclose(tree["mixture/mean"], mean, rtol=1e-9)
    np.testing.assert_allclose(tree["mixture/sd"], np.sqrt(weights @ (sds**2 + (means - mean) ** 2)), rtol=1e-9)
    low, high = tree["mixture/q05"].sel(parameter="phi"), tree["mixture/q95"].sel(parameter="phi")
    assert low < -0.3
    assert high > 0.3


def test_everything_stored_has_a_unit_and_a_name(run):
    assert unlabelled(run[1]) == []


def test_draws_hold_each_solution_as_often_as_its_weight(run):
    _, tree = run
    solution = tree["mixture/sample_stats/mode"].values
    weight = tree["modes/m1"].attrs["probability"]
    assert np.mean(solution == 1) == pytest.approx(weight, abs=5 * np.sqrt(weight * (1 - weight) / solution.size))
    first, sign = solution == 1, np.sign(tree["modes/m1/value"].sel(parameter="phi").item())
    assert np.all(np.sign(tree["mixture/posterior/phi"].values[first]) == sign)
    assert check_result(tree) == []


def test_page_shows_all_solutions_together(run):
    page = build_uncertainty(run[0]).read_text(encoding="utf-8")
    assert '<section id="mixture"' in page
