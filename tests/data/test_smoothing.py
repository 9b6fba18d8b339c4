import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import spsolve

from mofit.data.signals import smooth_derivative
from mofit.data.signals.smoothing import quantisation_step, residual_noise, smooth

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
    _, slope_without_noise = smooth_derivative(time, rounded, 0.0)
    for found in (slope, slope_without_noise):
        assert np.sqrt(np.mean((found - 3 * np.cos(3 * time)) ** 2)) < 0.03 * 3


def penalised(values, stiffness):
    """The known answer: z of (1 + stiffness DᵀD) z = values, D the third difference."""
    difference = third_difference(len(values))
    return spsolve((sparse.eye_array(len(values)) + stiffness * difference.T @ difference).tocsc(), values)


def third_difference(n):
    return sparse.diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(n - 3, n))


def test_the_trade_of_noise_and_bias_is_near_the_best_possible():
    time = np.arange(2000) * 0.01
    values = np.sin(2 * time) + 0.3 * np.sin(11 * time)
    noisy = values + 0.05 * RNG.normal(size=len(time))
    chosen = np.mean((smooth(noisy, 0.05).values - values) ** 2)
    best = min(np.mean((penalised(noisy, stiffness) - values) ** 2) for stiffness in np.logspace(-2, 8, 41))
    assert chosen < 1.3 * best


def test_the_smoother_and_its_degrees_of_freedom_are_those_of_the_penalty():
    values = np.sin(np.arange(300) * 0.05) + 0.1 * RNG.normal(size=300)
    found = smooth(values)
    penalty = (third_difference(300).T @ third_difference(300)).toarray()
    # the stiffness follows from the normal equations
    push = penalty @ found.values
    stiffness = float((values - found.values) @ push / (push @ push))
    np.testing.assert_allclose(penalised(values, stiffness), found.values, rtol=1e-6, atol=1e-9)
    trace = np.trace(np.linalg.inv(np.eye(300) + stiffness * penalty))
    assert found.degrees_of_freedom == pytest.approx(trace, rel=0.02)


@pytest.mark.parametrize("level", [1e-3, 0.05, 1.0])
def test_noise_of_a_smooth_signal_that_does_not_repeat(level):
    time = np.arange(2000) * 0.01
    signal = 10 * (1 - np.exp(-time / 0.7)) + np.sin(time)
    levels = [residual_noise(signal + level * np.random.default_rng(k).normal(size=2000))[0] for k in range(10)]
    assert np.mean(levels) == pytest.approx(level, rel=0.03)


def test_noise_of_a_broad_signal_that_does_not_repeat():
    rng = np.random.default_rng(0)
    # white up to 0.6 of the Nyquist frequency
    spectrum = np.fft.rfft(rng.normal(size=8192))
    spectrum[int(0.6 * len(spectrum)) :] = 0
    level, method = residual_noise(np.fft.irfft(spectrum) + 0.02 * rng.normal(size=8192))
    assert method == "top of spectrum"
    assert level == pytest.approx(0.02, rel=0.1)


def test_the_resolution_of_a_quantised_signal():
    time = np.arange(1000) * 0.01
    rounded = np.round(np.sin(time) / 0.02) * 0.02 + 7
    assert quantisation_step(rounded) == pytest.approx(0.02)
    assert quantisation_step(np.sin(time)) == 0
    assert residual_noise(rounded)[0] >= 0.0057
