"""The spectrum of noise against processes whose spectrum is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.signals.autoregressive import autoregressive_spectrum

COUNT = 2000


def draws(coefficients, rng, number):
    noise = lfilter([1.0], coefficients, rng.standard_normal((number, COUNT + 300)), axis=1)[:, 300:]
    return np.abs(np.fft.rfft(noise, axis=1)) ** 2 / COUNT


def truth(coefficients):
    turn = np.exp(-2j * np.pi * np.arange(COUNT // 2 + 1) / COUNT)
    return 1 / np.abs(np.polyval(coefficients[::-1], turn)) ** 2


@pytest.mark.parametrize("coefficients", [[1.0], [1.0, -0.8], [1.0, -1.2, 0.72]], ids=["white", "AR(1)", "resonant"])
def test_unbiased_and_as_sure_as_it_says(coefficients):
    """Ratio to the truth: mean 1, variance 2 / degrees of freedom; also with the lines of a period left out."""
    known = np.ones(COUNT // 2 + 1, dtype=bool)
    known[::10] = False
    exact, bins = truth(coefficients), [5, 60, 333, 700]
    found = [
        autoregressive_spectrum(power, known, COUNT) for power in draws(coefficients, np.random.default_rng(4), 80)
    ]
    ratio = np.array([spectrum[bins] / exact[bins] for spectrum, _ in found])
    freedom = np.mean([freedom[bins] for _, freedom in found], axis=0)
    np.testing.assert_allclose(ratio.mean(axis=0), 1.0, atol=0.06)
    assert np.all(np.abs(np.log(ratio.var(axis=0) / (2 / freedom))) < np.log(2.5))


def test_unknown_bins_do_not_matter():
    power, known = draws([1.0, -0.8], np.random.default_rng(1), 1)[0], np.ones(COUNT // 2 + 1, dtype=bool)
    known[20::20] = False
    wild = np.where(known, power, 1e6)
    np.testing.assert_array_equal(
        autoregressive_spectrum(power, known, COUNT)[0], autoregressive_spectrum(wild, known, COUNT)[0]
    )


def test_next_to_nothing_known():
    power, known = np.ones(11), np.zeros(11, dtype=bool)
    assert np.all(autoregressive_spectrum(power, known, 20)[1] == 2.0)
    known[3:6] = True
    spectrum, freedom = autoregressive_spectrum(np.where(known, 2.0, 50.0), known, 20)
    np.testing.assert_allclose(spectrum, 2.0)
    np.testing.assert_allclose(freedom, 6.0)
