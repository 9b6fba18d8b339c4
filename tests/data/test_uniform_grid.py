"""Interpolation and low-pass against sines, whose samples are known at any time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.data.importers.uniform_grid import LOW_PASS, Signal, on_grid

RATE, COUNT = 1000.0, 2000
#: samples at the ends in which the filter sees what is beyond the record
EDGE = LOW_PASS.half_length + 1


def sine(frequency, time, phase=0.3):
    return np.sin(2 * np.pi * frequency * time + phase)


def jittered(jitter, seed):
    """Stamps off the grid by at most ``jitter`` steps."""
    return (np.arange(COUNT) + np.random.default_rng(seed).uniform(-jitter, jitter, COUNT)) / RATE


@given(
    frequency=st.floats(0.5, 100.0),
    jitter=st.floats(0.0, 0.3),
    rate=st.floats(900.0, 3000.0),
    seed=st.integers(0, 99),
    linear=st.booleans(),
)
def test_a_sine_of_jittering_stamps_keeps_within_the_bound_of_its_interpolation(frequency, jitter, rate, seed, linear):
    time = jittered(jitter, seed)
    start = time[20]  # the bound of the spline holds away from its ends
    count = int((time[-20] - start) * rate)
    found = on_grid(Signal(time, sine(frequency, time)), start, count, rate, linear)
    error = np.max(np.abs(found - sine(frequency, start + np.arange(count) / rate)))
    largest = 2 * np.pi * frequency * np.max(np.diff(time))
    # |f - s| <= h^4/384 * 5 max |f''''| (Hall and Meyer 1976), and h^2/8 max |f''| of straight lines
    assert error <= (largest**2 / 8 if linear else 5 / 384 * largest**4) + 1e-9


@given(rate=st.floats(20.0, 890.0), share=st.floats(0.0, 1.0), phase=st.floats(0, 6))
def test_a_tone_above_the_new_nyquist_frequency_is_gone_by_60_dB(rate, share, phase):
    time = np.arange(10 * COUNT) / RATE
    nyquist = rate / 2
    tone = nyquist + share * (0.999 * RATE / 2 - nyquist)
    count = int(time[-1] * rate)
    found = on_grid(Signal(time, sine(tone, time, phase)), 0.0, count, rate, False)[EDGE:-EDGE]
    assert np.max(np.abs(found), initial=0.0) < 1e-3


@given(rate=st.floats(20.0, 890.0), share=st.floats(0.01, 1.0))
def test_what_the_new_rate_holds_keeps_size_and_phase(rate, share):
    time = np.arange(10 * COUNT) / RATE
    frequency = share * min(LOW_PASS.pass_band * rate, RATE / 10)
    count = int(time[-1] * rate)
    found = on_grid(Signal(time, sine(frequency, time)), 0.0, count, rate, False)
    # the ripple of the pass band and the spline, which has at least ten samples per period
    np.testing.assert_allclose(found[EDGE:-EDGE], sine(frequency, np.arange(count) / rate)[EDGE:-EDGE], atol=4e-4)


def test_a_slow_tone_of_jittering_stamps_is_kept_and_one_above_is_gone():
    time = jittered(0.3, 1)
    slow, fast = sine(10, time), sine(120, time)
    count = int((time[-1] - time[0]) * 200)
    found = on_grid(Signal(time, slow + fast), time[0], count, 200.0, False)
    expected = sine(10, time[0] + np.arange(count) / 200)
    largest = 2 * np.pi * 120 * np.max(np.diff(time))
    np.testing.assert_allclose(found[EDGE:-EDGE], expected[EDGE:-EDGE], atol=5 / 384 * largest**4)


def test_a_line_is_kept_to_its_ends():
    time = np.arange(500) / RATE
    found = on_grid(Signal(time, 3 * time - 1), 0.0, 50, 100.0, False)
    np.testing.assert_allclose(found, 3 * np.arange(50) / 100 - 1, atol=1e-12)


def test_a_rounded_rate_does_not_filter():
    time = np.arange(500) / 100.4
    values = np.random.default_rng(0).standard_normal(500)
    np.testing.assert_allclose(
        on_grid(Signal(time, values), 0.0, 400, 100.0, True), np.interp(np.arange(400) / 100, time, values)
    )


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_very_short_signals(samples):
    time = np.arange(samples) / 10
    np.testing.assert_allclose(on_grid(Signal(time, time + 1), 0.0, samples, 10.0, False), time + 1)
