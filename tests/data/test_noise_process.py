"""The noise process: how its level grows with the signal, and its spectrum against processes of known spectrum."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.data.signals.autoregressive import autoregressive_spectrum
from mofit.data.signals.noise_process import noise_process

SAMPLES, PERIODS = 800, 8
TIME = np.arange(SAMPLES) * 0.01
SIGNAL = np.sin(2 * np.pi * PERIODS / (SAMPLES * 0.01) * TIME)


def level_where_small(coefficient, share, seed):
    """Mean variance, relative, where the signal is small."""
    noise = lfilter([1.0], [1.0, -coefficient], np.random.default_rng(seed).standard_normal(SAMPLES + 200))[200:]
    process = noise_process(noise * share, SIGNAL, TIME, SAMPLES * 0.01 / PERIODS)
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


LENGTH = 2000


def draws(coefficients, rng, number):
    noise = lfilter([1.0], coefficients, rng.standard_normal((number, LENGTH + 300)), axis=1)[:, 300:]
    return np.fft.rfft(noise, axis=1) / np.sqrt(LENGTH)


def truth(coefficients):
    turn = np.exp(-2j * np.pi * np.arange(LENGTH // 2 + 1) / LENGTH)
    return 1 / np.abs(np.polyval(coefficients[::-1], turn)) ** 2


@pytest.mark.parametrize("coefficients", [[1.0], [1.0, -0.8], [1.0, -1.2, 0.72]], ids=["white", "AR(1)", "resonant"])
def test_unbiased_with_the_variance_it_states(coefficients):
    """Ratio to the truth: mean 1, variance 2 / degrees of freedom; also with the lines of a period left out."""
    known = np.ones(LENGTH // 2 + 1, dtype=bool)
    known[::10] = False
    exact, bins = truth(coefficients), [5, 60, 333, 700]
    found = [
        autoregressive_spectrum(lines, known, LENGTH).averaged()
        for lines in draws(coefficients, np.random.default_rng(4), 80)
    ]
    ratio = np.array([spectrum[bins] / exact[bins] for spectrum, _ in found])
    freedom = np.mean([freedom[bins] for _, freedom in found], axis=0)
    np.testing.assert_allclose(ratio.mean(axis=0), 1.0, atol=0.06)
    assert np.all(np.abs(np.log(ratio.var(axis=0) / (2 / freedom))) < np.log(2.5))


def test_unknown_bins_do_not_matter():
    lines, known = draws([1.0, -0.8], np.random.default_rng(1), 1)[0], np.ones(LENGTH // 2 + 1, dtype=bool)
    known[20::20] = False
    wild = np.where(known, lines, 1e3)
    np.testing.assert_array_equal(
        autoregressive_spectrum(lines, known, LENGTH).averaged()[0],
        autoregressive_spectrum(wild, known, LENGTH).averaged()[0],
    )


def test_almost_no_known_bins():
    lines, known = np.ones(11), np.zeros(11, dtype=bool)
    assert np.all(autoregressive_spectrum(lines, known, 20).averaged()[1] == 2.0)
    known[3:6] = True
    spectrum, freedom = autoregressive_spectrum(np.sqrt(np.where(known, 2.0, 50.0)), known, 20).averaged()
    np.testing.assert_allclose(spectrum, 2.0)
    np.testing.assert_allclose(freedom, 6.0)
