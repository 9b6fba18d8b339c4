import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.data.signals.periodicity import find_period, overlap_noise, repeat_noise, sine_period


def grid(duration, rate):
    return np.arange(round(duration * rate)) / rate


@settings(deadline=None, max_examples=40)
@given(
    frequency=st.floats(0.3, 8.0),
    periods=st.floats(2.2, 25.0),
    phase=st.floats(0, 6.28),
    third=st.floats(0, 0.1),
    seed=st.integers(0, 50),
)
def test_a_sine_is_found_to_a_ten_thousandth(frequency, periods, phase, third, seed):
    time = 3.0 + grid(periods / frequency, 50 * frequency * 0.997)
    angle = 2 * np.pi * frequency * time + phase
    noise = 0.003 * np.random.default_rng(seed).normal(size=len(time))
    found = sine_period(time, 0.5 + np.sin(angle) + third * np.sin(3 * angle) + noise)
    # the Cramér-Rao bound of the shortest records is about 1e-4
    assert found == pytest.approx(1 / frequency, rel=1e-3 if periods < 4 else 1e-4)


@pytest.mark.parametrize("off", [0.98, 1.02])
def test_the_label_plays_no_role(off):
    time = grid(12.0, 97.0)
    assert sine_period(time, np.sin(2 * np.pi * off * time)) == pytest.approx(1 / off, rel=1e-6)


def test_ramps_at_both_ends_do_not_disturb():
    time = grid(12.0, 200.0)
    ramp = np.clip(np.minimum(time, 12 - time) / 1.5, 0, 1)
    assert sine_period(time, ramp * np.sin(2 * np.pi * 1.016 * time)) == pytest.approx(1 / 1.016, rel=2e-4)


def multisine(time, period, seed, lines=40):
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, lines)
    return sum(np.cos(2 * np.pi * (k + 1) * time / period + phases[k]) for k in range(lines))


@settings(deadline=None, max_examples=25)
@given(period=st.floats(0.8, 3.0), periods=st.floats(1.6, 9.0), seed=st.integers(0, 50))
def test_a_multisine_is_found_though_its_period_is_no_whole_number_of_samples(period, periods, seed):
    time = grid(periods * period, 400.0)
    noise = 0.02 * np.random.default_rng(seed).normal(size=len(time))
    assert find_period(time, multisine(time, period, seed) + noise) == pytest.approx(period, rel=1e-4)


def test_one_period_and_a_short_lead_in_suffice():
    step = 1 / 610.0
    time = np.arange(2048 + 200) * step
    found = find_period(time, multisine(time, 2048 * step, 3, lines=600))
    assert found == pytest.approx(2048 * step, rel=1e-4)


def test_a_repeated_trajectory():
    time = grid(24.8, 200.0)
    place = (time % 6.14) / 6.14
    values = np.interp(place, [0, 0.1, 0.4, 0.5, 0.8, 0.95, 1.0], [0, 0, 0.25, 0.1, -0.25, 0, 0])
    noise = 1e-4 * np.random.default_rng(0).normal(size=len(time))
    assert find_period(time, values + noise) == pytest.approx(6.14, rel=1e-4)


TIME = grid(20.0, 100.0)
NOT_PERIODIC = {
    "linear chirp": np.sin(2 * np.pi * (0.1 * TIME + 0.2 * TIME**2)),
    "logarithmic chirp": np.sin(2 * np.pi * 0.2 * 4 * np.exp(TIME / 4)),
    "step": np.where(TIME > 4, 1.0, 0.0),
    "ramp": TIME,
    "pulse": np.exp(-((TIME - 9) ** 2)),
    "decay": np.exp(-TIME) * np.cos(9 * TIME),
    "white noise": np.random.default_rng(1).normal(size=len(TIME)),
    "slow noise": np.convolve(np.random.default_rng(2).normal(size=len(TIME) + 99), np.hanning(100), "valid"),
    "random walk": np.cumsum(np.random.default_rng(3).normal(size=len(TIME))),
    "constant": np.ones_like(TIME),
}


@pytest.mark.parametrize("name", NOT_PERIODIC)
def test_what_does_not_repeat_has_no_period(name):
    assert find_period(TIME, NOT_PERIODIC[name]) is None
    assert sine_period(TIME, NOT_PERIODIC[name]) is None


@pytest.mark.parametrize("seed", range(20))
def test_chance_does_not_make_periods(seed):
    rng = np.random.default_rng(seed)
    width = int(rng.integers(2, 60))
    values = np.convolve(rng.normal(size=len(TIME) + width - 1), np.hanning(width + 2)[1:-1], "valid")
    assert find_period(TIME, values) is None


def white(rng, n):
    return rng.normal(size=n)


def coloured(rng, n):
    """First-order noise with a memory of 20 samples, unit standard deviation."""
    a = np.exp(-1 / 20)
    values = rng.normal(size=n + 200)
    for i in range(1, n + 200):
        values[i] = a * values[i - 1] + np.sqrt(1 - a**2) * values[i]
    return values[200:]


@pytest.mark.parametrize("noise", [white, coloured])
@pytest.mark.parametrize("samples_per_period", [100.0, 100.37])
@pytest.mark.parametrize("periods", [2.0, 4.5, 30.2])
def test_noise_from_repeated_periods(noise, samples_per_period, periods):
    n = round(samples_per_period * periods)
    time = np.arange(n) * 0.01
    period = samples_per_period * 0.01
    phase = 2 * np.pi * time / period
    # a waveform with kinks, as friction makes
    signal = 50 * np.sin(phase) + 20 * np.clip(5 * np.sin(phase + 1), -1, 1)
    runs = 60 if noise is white else 40
    levels = [repeat_noise(time, signal + noise(np.random.default_rng(k), n), period) for k in range(runs)]
    mean_square = np.mean(np.square(levels))
    # coloured noise has few independent samples: the scatter of the mean is wider
    allowed = 0.04 if noise is white else 0.12
    assert np.sqrt(mean_square) == pytest.approx(1.0, abs=allowed)


def test_noise_of_one_period_and_its_lead_in():
    rng = np.random.default_rng(0)
    period = rng.normal(size=3000)
    values = np.concatenate([period[-1000:], period]) + 0.02 * rng.normal(size=4000)
    time = np.arange(4000) * 0.01
    assert overlap_noise(time, values, 30.0) == pytest.approx(0.02, rel=0.1)
