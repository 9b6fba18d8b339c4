import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.signals import smooth, smooth_derivative
from mofit.signals.smoothing import _system

RNG = np.random.default_rng(0)


@settings(deadline=None, max_examples=30)
@given(
    frequency=st.floats(0.2, 2.0), phase=st.floats(0, 6.28), amplitude=st.floats(1e-4, 1e3), offset=st.floats(-10, 10)
)
def test_a_clean_sine_has_its_analytic_derivative(frequency, phase, amplitude, offset):
    time = 2.0 + np.arange(800) * 0.01
    omega = 2 * np.pi * frequency
    values = amplitude * (np.sin(omega * time + phase) + offset)
    smoothed, slope = smooth_derivative(time, values)
    exact = amplitude * omega * np.cos(omega * time + phase)
    np.testing.assert_allclose(smoothed, values, atol=1e-4 * amplitude)
    np.testing.assert_allclose(slope, exact, atol=2e-3 * amplitude * omega)


@given(coefficients=st.tuples(*[st.floats(-5, 5)] * 3), noise_sd=st.floats(1e-3, 1.0))
@settings(deadline=None, max_examples=20)
def test_parabolas_pass_whatever_the_noise_level(coefficients, noise_sd):
    time = np.arange(200) * 0.02
    smoothed, slope = smooth_derivative(time, np.polyval(coefficients, time), noise_sd)
    np.testing.assert_allclose(smoothed, np.polyval(coefficients, time), atol=1e-6)
    np.testing.assert_allclose(slope, np.polyval(np.polyder(np.array(coefficients)), time), atol=1e-4)


@pytest.mark.parametrize("given_level", [True, False])
@pytest.mark.parametrize("level", [0.002, 0.02])
def test_noise_is_not_differentiated(given_level, level):
    time = np.arange(4000) * 0.005
    values, exact = np.sin(3 * time), 3 * np.cos(3 * time)
    noisy = values + level * RNG.normal(size=len(time))
    smoothed, slope = smooth_derivative(time, noisy, level if given_level else None)
    raw = np.gradient(noisy, time)
    error = np.sqrt(np.mean((slope - exact) ** 2))
    assert error < 0.05 * np.sqrt(np.mean((raw - exact) ** 2))
    assert np.sqrt(np.mean((smoothed - values) ** 2)) < 0.3 * level


def test_quantisation_counts_as_noise():
    time = np.arange(4000) * 0.005
    rounded = np.round(np.sin(3 * time) / 0.01) * 0.01
    _, slope = smooth_derivative(time, rounded)
    _, slope_told_none = smooth_derivative(time, rounded, 0.0)
    for found in (slope, slope_told_none):
        assert np.sqrt(np.mean((found - 3 * np.cos(3 * time)) ** 2)) < 0.03 * 3


def test_the_trade_of_noise_and_bias_is_near_the_best_possible():
    time = np.arange(2000) * 0.01
    values = np.sin(2 * time) + 0.3 * np.sin(11 * time)
    noisy = values + 0.05 * RNG.normal(size=len(time))
    chosen = np.mean((smooth(noisy, 0.05).values - values) ** 2)
    best = min(np.mean((_solve(noisy, stiffness) - values) ** 2) for stiffness in np.logspace(-2, 8, 41))
    assert chosen < 1.3 * best


def _solve(values, stiffness):
    from scipy.linalg import solveh_banded

    return solveh_banded(_system(len(values), stiffness), values)


def test_the_banded_system_is_the_penalty():
    n, stiffness = 12, 3.7
    difference = np.diff(np.eye(n), n=3, axis=0)
    full = np.eye(n) + stiffness * difference.T @ difference
    values = RNG.normal(size=n)
    np.testing.assert_allclose(_solve(values, stiffness), np.linalg.solve(full, values), rtol=1e-9)


def test_degrees_of_freedom_are_the_trace_of_the_smoother():
    values = np.sin(np.arange(300) * 0.05) + 0.1 * RNG.normal(size=300)
    found = smooth(values)
    difference = np.diff(np.eye(300), n=3, axis=0)
    stiffness = _matching_stiffness(values, found.values)
    trace = np.trace(np.linalg.inv(np.eye(300) + stiffness * difference.T @ difference))
    assert found.freedom == pytest.approx(trace, rel=0.02)


def _matching_stiffness(values, smoothed):
    """The stiffness at which these values give this smooth curve, from its normal equations."""
    difference = np.diff(np.eye(len(values)), n=3, axis=0)
    push = difference.T @ difference @ smoothed
    return float((values - smoothed) @ push / (push @ push))
