"""More tests than the hypervolume takes objectives: the run ends, and its page is written."""

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model
from mofit.optimize.pareto_front import hypervolume
from mofit.parameters import Parameter

TESTS = 34


class Line(Model):
    """y = k x + b, with an offset per test."""

    name = "line"
    parameters = (Parameter("k", "N/m", 0.1, 10.0, 1.0, "log"), Parameter("b", "N", -10.0, 10.0, 0.0, per="test"))
    inputs = (Channel("x", "m"),)
    outputs = (Channel("y", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"y": s.k * s.x + s.b})


@pytest.mark.slow
def test_a_run_of_many_tests_ends_with_a_result(tmp_path) -> None:
    rng, time, measurements = np.random.default_rng(0), 0.01 * np.arange(200), []
    for t in range(TESTS):
        x = np.sin(time**2 + t)
        y = 2.0 * x + t / 10 + 0.1 * rng.normal(size=len(time))
        experiment = Experiment(f"test {t}", "free", time, {"x": x}, {})
        measurements.append(Measurement(experiment, {"y": y}, {"x": "m", "y": "N"}))
    campaign = Campaign("many", "simulated", {}, tuple(measurements))
    folder, tree = identify(campaign, Line(), Settings(evaluations=60, sample=False, jobs=1), out=tmp_path / "run")
    assert (folder / "report.html").exists()
    assert np.isnan(tree["search"].dataset["hypervolume"].values[-1])
    offsets = tree["modes/m1/scoped"].dataset["value"].values[:, 0]
    np.testing.assert_allclose(offsets, np.arange(TESTS) / 10, atol=0.05)


def test_hypervolume_of_a_few_points_agrees_beyond_the_exact_number_of_objectives() -> None:
    """One point: the box that it dominates, exact or approximated."""
    for objectives, error in ((3, 1e-12), (10, 1e-12), (14, 0.03), (30, 0.03)):
        share = hypervolume(np.full((1, objectives), 0.05), np.zeros(objectives), np.ones(objectives))
        np.testing.assert_allclose(share, 0.95**objectives, atol=error)
