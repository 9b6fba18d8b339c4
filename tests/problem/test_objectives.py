"""Objectives against closed forms and finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.data.signals import effective_samples
from mofit.problem import GaussianPrior, join_priors
from mofit.problem.likelihood import (
    Noise,
    TestSums,
    common_gap,
    likelihood_terms,
    negative_log_likelihood,
    nrmsd,
)


def test_nrmsd_is_eq_10():
    measured = np.array([1.0, 4.0, -2.0, 0.0])
    simulated = measured + np.array([0.1, -0.2, 0.3, 0.0])
    spread = np.ptp(measured)
    cost = np.sum((measured - simulated) ** 2) / spread**2
    expected = np.sqrt(np.mean((measured - simulated) ** 2)) / spread
    assert nrmsd(np.array([[cost]]), np.array([4.0]))[0, 0] == pytest.approx(expected, rel=1e-14)


def test_white_noise_counts_every_sample():
    rng = np.random.default_rng(1)
    counts = [effective_samples(rng.normal(size=4000)) for _ in range(50)]
    assert np.mean(counts) == pytest.approx(4000, rel=0.03)


@pytest.mark.parametrize("phi", [0.5, 0.8, 0.95])
def test_coloured_noise_counts_as_its_variance_estimate_does(phi):
    # n / sum of squared autocorrelations: AR(1) has (1 + phi^2) / (1 - phi^2)
    rng = np.random.default_rng(2)
    counts = []
    for _ in range(40):
        noise = rng.normal(size=20_000)
        for k in range(1, len(noise)):
            noise[k] += phi * noise[k - 1]
        counts.append(effective_samples(noise))
    assert np.mean(counts) == pytest.approx(20_000 * (1 - phi**2) / (1 + phi**2), rel=0.1)


@given(cycles=st.integers(2, 40), phase=st.floats(0, 6.28))
def test_a_single_line_counts_four(cycles, phase):
    residual = np.cos(2 * np.pi * cycles * np.arange(1000) / 1000 + phase)
    assert effective_samples(residual) == pytest.approx(4, rel=1e-6)


def _sums(theta):
    """Two tests of linear residuals r = A theta - b with known derivatives."""
    rng = np.random.default_rng(3)
    designs = [(rng.normal(size=(30, 2)), rng.normal(size=30)), (rng.normal(size=(50, 2)), rng.normal(size=50))]
    residuals = [a @ theta - b for a, b in designs]
    return TestSums(
        cost=np.array([[r @ r for r in residuals]]),
        gradient=np.array([[a.T @ r for (a, _), r in zip(designs, residuals, strict=True)]]),
        normal=np.array([[a.T @ a for a, _ in designs]]),
    )


FLOOR = np.array([0.1, 0.3])


@pytest.mark.parametrize("gap", [np.inf, 0.2, 0.0])
def test_likelihood_gradient_matches_differences(gap):
    noise = Noise(np.array([30.0, 50.0]), FLOOR, np.array([20.0, 50.0]), gap)
    theta, step = np.array([0.3, -0.7]), 1e-6
    value, gradient, hessian = likelihood_terms(_sums(theta), noise)
    assert value == pytest.approx(negative_log_likelihood(_sums(theta).cost, noise))
    for i in range(2):
        shift = np.eye(2)[i] * step
        up = negative_log_likelihood(_sums(theta + shift).cost, noise)[0]
        down = negative_log_likelihood(_sums(theta - shift).cost, noise)[0]
        assert gradient[0, i] == pytest.approx((up - down) / (2 * step), rel=1e-7)
    assert np.all(np.linalg.eigvalsh(hessian[0]) > 0)


def test_marginal_likelihood_is_the_integral_over_the_noise_level():
    # two tests, n residuals of variance s^2 v: integral of s^-n exp(-sum C / 2 v s^2) ds / s over s
    count = np.array([5.0, 7.0])
    noise = Noise(count, FLOOR, count, 0.2)
    log_s = np.linspace(-10, 10, 40_001)
    costs = np.array([[0.5, 0.1], [3.0, 2.0]])
    exponents = [-12 * log_s - c @ (1 / noise.variance) / 2 * np.exp(-2 * log_s) for c in costs]
    integrals = [np.log(np.trapezoid(np.exp(e), log_s)) for e in exponents]
    ours = -negative_log_likelihood(costs, noise)
    assert ours[0] - ours[1] == pytest.approx(integrals[0] - integrals[1], rel=1e-6)


def test_a_known_gap_is_found(rng):
    floor, gap, independent = np.array([0.002, 0.01, 0.03]), 0.015, np.full(3, 4000.0)
    errors = rng.normal(size=(3, 4000)) * np.sqrt(floor**2 + gap**2)[:, None]
    found = common_gap(np.sqrt(np.mean(errors**2, axis=1)), floor, independent)
    assert found == pytest.approx(gap, rel=0.03)


def test_no_gap_where_the_noise_explains_all():
    floor = np.array([0.002, 0.01])
    assert common_gap(0.99 * floor, floor, np.array([100.0, 100.0])) == 0.0
    assert common_gap(np.zeros(2), np.zeros(2), np.ones(2)) == 0.0


def test_perfect_data_stay_finite():
    noise = Noise(np.array([10.0]), np.zeros(1), np.array([10.0]), 0.0)
    assert np.isfinite(negative_log_likelihood(np.zeros((1, 1)), noise)).all()


def test_priors_join_and_spread():
    first = GaussianPrior(("b",), np.array([0.2]), np.array([[4.0]]))
    second = GaussianPrior(("c", "a"), np.array([0.3, 0.9]), np.array([[2.0, 1.0], [1.0, 3.0]]))
    joined = join_priors([first, second])
    wide = joined.over(("c", "b", "a", "free"))
    mean, precision = wide.mean, wide.precision
    assert mean[:3] == pytest.approx([0.3, 0.2, 0.9])
    expected = np.zeros((4, 4))
    expected[0, 0], expected[1, 1], expected[2, 2], expected[0, 2], expected[2, 0] = 2.0, 4.0, 3.0, 1.0, 1.0
    assert precision == pytest.approx(expected)
