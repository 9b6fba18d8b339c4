"""Pooled offsets of a linear model: the posterior of a linear mixed model."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter
from mofit.problem.scoped_estimates import scoped_estimates

NOISE, SPREAD, MEAN, SLOPE, TESTS, SAMPLES = 0.5, 2.0, 3.0, 1.5, 12, 400


class Offset(Model):
    """y = k x + b."""

    name = "offset"
    parameters = (Parameter("k", "N/m", -10.0, 10.0, 1.0), Parameter("b", "N", -20.0, 20.0, 0.0))
    inputs = (Channel("x", "m"),)
    outputs = (Channel("y", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"y": s.k * s.x + s.b})


def campaign(seed: int) -> Campaign:
    """Tests with an offset each, drawn from a normal."""
    rng, measurements = np.random.default_rng(seed), []
    for t in range(TESTS):
        time = 0.01 * np.arange(SAMPLES)
        x = np.cumsum(np.sin(time**2 + t)) / 20  # slow beside the noise, and never the same
        y = SLOPE * x + rng.normal(MEAN, SPREAD) + NOISE * rng.normal(size=SAMPLES)
        experiment = Experiment(name=f"t{t}", kind="free", time=time, inputs={"x": x}, conditions={})
        measurements.append(Measurement(experiment, {"y": y}, {"x": "m", "y": "N"}))
    return Campaign("offsets", "simulated", {}, tuple(measurements))


SETTINGS = Settings(pooled=("b",), evaluations=60, jobs=1)


def test_density_is_that_of_a_linear_mixed_model() -> None:
    data = campaign(1)
    setup = set_up_problem(Offset(), data, SETTINGS)
    assert setup.searched.space.names == ("k",)
    assert setup.posterior.space.names == ("k", "b_mean", "b_spread")
    space = setup.posterior.space
    points = np.array([[1.5, 3.0, 2.0], [1.505, 2.0, 1.5], [1.495, 3.5, 4.0]])
    problem = setup.posterior.with_noise_at(space.to_unit(points[0]))
    ours = problem.log_posterior(space.to_unit(points))
    exact = []
    for k, mean, spread in points:
        total, covariance = 0.0, NOISE**2 * np.eye(SAMPLES) + spread**2
        for m in data.measurements:
            total += multivariate_normal(np.full(SAMPLES, mean), covariance).logpdf(m.channel("y") - k * m.channel("x"))
        exact.append(total)
    assert ours - ours[0] == pytest.approx(np.array(exact) - exact[0], rel=0.15, abs=0.5)


def test_gradient_and_curvature_by_mean_and_spread_are_those_of_differences() -> None:
    setup = set_up_problem(Offset(), campaign(2), SETTINGS)
    space = setup.posterior.space
    point = space.to_unit([1.4, 2.0, 1.2])
    problem = setup.posterior.with_noise_at(point)
    _, gradient, hessian = problem.prior_terms(point[None])
    step = 1e-6
    for k in range(3):
        shift = step * np.eye(3)[k]
        both = problem.prior_terms(np.stack([point + shift, point - shift]))
        assert gradient[0, k] == pytest.approx((both[0][0] - both[0][1]) / (2 * step), rel=1e-4, abs=1e-3)
    assert np.linalg.eigvalsh(hessian[0])[0] >= -1e-9


@pytest.mark.slow
def test_mean_and_spread_are_found_and_sampled() -> None:
    found = locate_minima(campaign(3), Offset(), SETTINGS)
    modes = sample_modes(adjusted_modes(found.posterior, found.minima, SETTINGS), SETTINGS)
    space = found.posterior.space
    draws = space.from_unit(modes[0].chains.thinned().points.reshape(-1, 3))
    offsets = [float(np.mean(m.channel("y") - SLOPE * m.channel("x"))) for m in campaign(3).measurements]
    assert modes[0].chains.converged
    assert draws[:, 1].mean() == pytest.approx(np.mean(offsets), abs=0.15)
    assert draws[:, 1].std() == pytest.approx(np.std(offsets) / np.sqrt(TESTS), rel=0.4)
    assert np.median(draws[:, 2]) == pytest.approx(np.std(offsets), rel=0.25)
    assert draws[:, 0].mean() == pytest.approx(SLOPE, abs=4 * NOISE / np.sqrt(TESTS * SAMPLES))


def test_pooled_estimates_are_drawn_towards_the_mean() -> None:
    setup = set_up_problem(Offset(), campaign(4), SETTINGS)
    space = setup.posterior.space
    point = space.to_unit([SLOPE, MEAN, 0.05])
    problem = setup.posterior.with_noise_at(point)
    estimates = scoped_estimates(problem, point, np.diag([1e-12, 1e-12, 1e-12]))
    assert estimates is not None
    own = np.array([float(np.mean(m.channel("y") - SLOPE * m.channel("x"))) for m in campaign(4).measurements])
    variance = problem.pooling.covariance[:, 0, 0]
    share = 0.05**2 / (0.05**2 + variance)
    assert estimates.values[:, 0] == pytest.approx(MEAN + share * (own - MEAN), abs=1e-4)
    assert estimates.sd[:, 0] == pytest.approx(np.sqrt(share * variance), rel=1e-3)
