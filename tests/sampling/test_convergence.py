"""Convergence numbers of processes whose values are known."""

import numpy as np
import pytest

from mofit.sampling import autocorrelation_time, effective_size, r_hat
from mofit.sampling.chains import thin


def test_r_hat_and_effective_size_of_known_processes():
    """Independent draws count fully, autocorrelated ones by (1 - rho) / (1 + rho); a shifted chain shows in R-hat."""
    rng, rho, count = np.random.default_rng(0), 0.8, 4000
    points = rng.normal(size=(4, count, 3))
    for t in range(1, count):
        points[:, t, 1] = rho * points[:, t - 1, 1] + np.sqrt(1 - rho**2) * points[:, t, 1]
    points[0, :, 2] += 2.0
    size = effective_size(points)
    assert size[0] == pytest.approx(4 * count, rel=0.1)
    assert size[1] == pytest.approx(4 * count * (1 - rho) / (1 + rho), rel=0.2)
    assert np.all(np.abs(r_hat(points)[:2] - 1) < 0.01)
    assert r_hat(points)[2] > 1.1


def test_a_parameter_that_never_moved_has_no_r_hat():
    assert np.isnan(r_hat(np.ones((4, 50, 1)))).all()


def test_too_few_draws_give_no_number():
    assert np.isnan(r_hat(np.zeros((4, 3, 2)))).all()
    assert effective_size(np.zeros((4, 3, 2))).tolist() == [0, 0]


def test_autocorrelation_time_of_an_autoregressive_process():
    rng, rho, steps = np.random.default_rng(0), 0.8, 4000
    x = np.empty((steps, 16))
    x[0] = rng.normal(size=16)
    for t in range(1, steps):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * rng.normal(size=16)
    frozen = np.ones_like(x)
    tau = autocorrelation_time(np.stack([x, frozen], axis=2))
    assert tau[0] == pytest.approx((1 + rho) / (1 - rho), rel=0.1)
    assert np.isinf(tau[1])


def test_thinning_keeps_home_walkers_in_the_order_of_time():
    chain = np.arange(2 * 10 * 3, dtype=float).reshape(2, 10, 3, 1)
    home = np.array([[True, False, True], [True, True, True]])
    draws = thin(chain, chain[..., 0], home, every=3, first=2)
    assert draws.step.tolist() == [[4, 4, 7, 7]] * 2
    assert draws.walker.tolist() == [[0, 2, 0, 2], [0, 1, 0, 1]]
    expected = [[chain[e, t, w, 0] for t, w in zip(draws.step[e], draws.walker[e], strict=True)] for e in range(2)]
    assert draws.points[..., 0].tolist() == expected == draws.log_prob.tolist()
