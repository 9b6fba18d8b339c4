"""Convergence numbers against ArviZ and against processes whose values are known."""

import numpy as np
import pytest
from arviz_stats.base import array_stats
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.sample import autocorrelation_time, effective_size, r_hat
from mofit.sample.draws import thin


@given(st.integers(0, 10_000), st.integers(4, 300), st.sampled_from([-0.5, 0.0, 0.3, 0.9, 0.995]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_r_hat_and_effective_size_are_arvizs(seed, count, rho, shifted):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4, count, 2))
    for t in range(1, count):
        points[:, t] = rho * points[:, t - 1] + np.sqrt(1 - rho**2) * points[:, t]
    points[0] += 2.0 * shifted
    points = np.round(points, 2)  # with ties
    expected_r, expected_n = (f(points, chain_axis=0, draw_axis=1) for f in (array_stats.rhat, array_stats.ess))
    np.testing.assert_allclose(r_hat(points), expected_r, rtol=1e-9)
    np.testing.assert_allclose(effective_size(points), expected_n, rtol=1e-7)


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
