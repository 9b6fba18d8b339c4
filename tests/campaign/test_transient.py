import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.signals import settled_samples
from mofit.signals.transient import find_settled


def response(periods, decay=None, noise=0.005, seed=0):
    time = np.arange(round(periods * 101.3)) / 101.3
    phase = 2 * np.pi * time
    wave = np.sin(phase) + 0.1 * np.sin(3 * phase)
    wave += 0.0 if decay is None else 2 * np.exp(-time / decay)
    return time, wave + noise * np.random.default_rng(seed).normal(size=len(time))


@pytest.mark.parametrize("decay", [0.2, 0.4, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_a_decaying_transient_ends_where_it_drowns_in_noise(decay, seed):
    time, values = response(12, decay, seed=seed)
    transient, tail = find_settled(time, values, 1.0)
    # it is 3 % at the start of the first window that passes, and 1 % a window later at the latest
    assert decay * np.log(2 / 0.03) < transient < decay * np.log(2 / 0.005) + 0.25
    assert tail == 0


@pytest.mark.parametrize("periods", [2.0, 2.5, 3.0, 7.4, 20.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_steady_record_has_none(periods, seed):
    time, values = response(periods, seed=seed)
    assert find_settled(time, values, 1.0) == (0.0, 0.0)


def test_a_slow_drift_is_none():
    time, values = response(12)
    assert find_settled(time, values + 0.01 * time, 1.0) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(30))
def test_noise_that_depends_on_what_it_was_before_is_none(seed):
    # 25 samples per period: of so coloured a noise they are worth five
    time, wave = np.arange(500) / 100, 3000 * np.sin(8 * np.pi * np.arange(500) / 100)
    noise = lfilter([12.0], [1, -0.8], np.random.default_rng(seed).normal(size=1000))[500:]
    assert find_settled(time, wave + noise, 0.25) == (0.0, 0.0)


def test_a_transient_shows_through_such_noise():
    time, wave = np.arange(500) / 100, 3000 * np.sin(8 * np.pi * np.arange(500) / 100)
    noise = lfilter([12.0], [1, -0.8], np.random.default_rng(1).normal(size=1000))[500:]
    transient, tail = find_settled(time, wave + noise + 600 * np.exp(-time / 0.3), 0.25)
    assert 0.3 * np.log(600 / 60) < transient < 0.3 * np.log(600 / 15) + 0.5
    assert tail == 0


def test_a_rig_that_stops_before_the_end_of_the_record():
    time, values = response(9)
    values[time > 7.5] = 0.0
    transient, tail = find_settled(time, values, 1.0)
    assert transient == 0
    assert tail == pytest.approx(1.5, abs=0.15)
    kept = settled_samples(time, transient, tail)
    assert time[kept][-1] == pytest.approx(7.5, abs=0.15)
    assert time[kept][0] == 0


def test_less_than_two_periods_tell_nothing():
    time, values = response(1.9, 0.3)
    assert find_settled(time, values, 1.0) == (0.0, 0.0)


def test_kept_samples_are_whole_periods_where_the_transient_is_one():
    time = 5 + np.arange(300) * 0.01
    assert np.count_nonzero(settled_samples(time, 1.0)) == 200
    assert np.count_nonzero(settled_samples(time, 1.0, 1.0)) == 100
