"""How noise grows with the signal: found where it does, and not made up where it doesn't."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.signals import noise_process

COUNT, PERIODS = 800, 8
TIME = np.arange(COUNT) * 0.01
SIGNAL = np.sin(2 * np.pi * PERIODS / (COUNT * 0.01) * TIME)


def level_where_small(coefficient, share, seed):
    """Mean variance, relative, where the signal is small."""
    noise = lfilter([1.0], [1.0, -coefficient], np.random.default_rng(seed).standard_normal(COUNT + 200))[200:]
    process = noise_process(noise * share, SIGNAL, TIME, COUNT * 0.01 / PERIODS)
    return np.mean(process.level[np.abs(SIGNAL) < 0.2] ** 2)


@pytest.mark.parametrize("coefficient", [0.0, 0.8])
def test_none_is_made_up(coefficient):
    found = [level_where_small(coefficient, 1.0, seed) for seed in range(60)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)


def test_growth_is_found():
    share = 0.3 + np.abs(SIGNAL)
    small = np.abs(SIGNAL) < 0.2
    truth = np.mean(share[small] ** 2) / np.mean(share**2)
    found = [level_where_small(0.0, share, seed) for seed in range(60)]
    assert np.mean(found) == pytest.approx(truth, rel=0.1)
