"""Noise behind a fit: restricted likelihood against its definition, and spectra of residuals against the noise's."""

import numpy as np
import pytest
from long_memory import long_memory
from scipy.signal import lfilter

from mofit.data.signals import NoiseProcess, noise_process
from mofit.data.signals.contrasts import Contrasts
from mofit.problem.curvature_adjustment import normal_variance

COUNT = 400
TIME = np.arange(COUNT) * 0.1
#: what a slow test of a spring tells from: its stroke, and the square of it
STROKE = np.interp(np.arange(COUNT), COUNT * np.array([0, 0.25, 0.75, 1.0]), [0.0, 1.0, -1.0, 0.0])
FITTED = np.stack([STROKE, STROKE * np.abs(STROKE)], axis=1)


def beside_fit(noise: np.ndarray) -> np.ndarray:
    return noise - FITTED @ np.linalg.lstsq(FITTED, noise)[0]


def test_restricted_likelihood_is_that_of_what_no_fit_changes(rng: np.random.Generator) -> None:
    """Differences between spectra, against the density of contrasts made by hand."""
    count, lines = 40, 21
    known = np.arange(lines) > 0
    signals, noise = rng.standard_normal((count, 3)), rng.standard_normal(count)
    transformed = np.fft.rfft(signals, axis=0) / np.sqrt(count)
    record = Contrasts.of(np.fft.rfft(noise) / np.sqrt(count), known, transformed)
    rows = np.concatenate([transformed[1:].real, transformed[1:-1].imag])
    values = np.concatenate([record.lines[0, 1:], record.lines[1, 1:-1]])
    contrasts = np.linalg.svd(rows)[0][:, 3:]

    def by_hand(spectrum: np.ndarray) -> float:
        variance = 0.5 * np.concatenate([spectrum[1:], spectrum[1:-1]])
        covariance = contrasts.T @ (variance[:, None] * contrasts)
        own = contrasts.T @ values
        return 0.5 * float(np.linalg.slogdet(covariance)[1] + own @ np.linalg.solve(covariance, own))

    def restricted(spectrum: np.ndarray) -> float:
        left = record.beside_fitted(spectrum)
        # the last line of an even count has no imaginary part
        logarithms = np.sum(np.log(spectrum[1:])) - 0.5 * np.log(spectrum[-1])
        return float(logarithms + np.sum((left.power / spectrum)[1:]) + 0.5 * left.log_information)

    one, other = np.linspace(3.0, 1.0, lines), 1 + rng.random(lines)
    assert restricted(one) - restricted(other) == pytest.approx(by_hand(one) - by_hand(other), rel=1e-9)


def test_signals_that_depend_on_each_other_count_once(rng: np.random.Generator) -> None:
    lines, known = np.fft.rfft(rng.standard_normal(COUNT)), np.arange(COUNT // 2 + 1) > 0
    signals = np.fft.rfft(FITTED, axis=0)
    again = np.concatenate([signals, 3 * signals[:, :1], np.zeros((len(signals), 1))], axis=1)
    once, twice = (Contrasts.of(lines, known, one).beside_fitted(np.ones(len(lines))) for one in (signals, again))
    np.testing.assert_allclose(once.power, twice.power)
    np.testing.assert_allclose(once.absorbed, twice.absorbed, atol=1e-12)
    assert once.absorbed.sum() == pytest.approx(1.0)  # two coefficients, and two parts of a line


def test_the_noise_before_a_fit_is_found_from_the_residual() -> None:
    """The power of AR(0.8) on the line of the stroke, half of which the fit has absorbed, against that of the noise."""
    rng = np.random.default_rng(3)
    found = {"restricted": [], "residual": []}
    for _ in range(25):
        noise = lfilter([1.0], [1.0, -0.8], rng.standard_normal(COUNT + 200))[200:]
        whole = noise_process(noise, STROKE, TIME, None).spectrum[1]
        for name, fitted in (("restricted", FITTED), ("residual", None)):
            process = noise_process(beside_fit(noise), STROKE, TIME, None, fitted=fitted)
            found[name].append(np.log(process.spectrum[1] / whole))
    assert np.mean(found["restricted"]) == pytest.approx(0.0, abs=0.1)
    assert np.mean(found["residual"]) < -0.15


def test_records_together_tell_a_long_memory() -> None:
    """Each alone hardly does; then coefficients of slow signals scatter as much as they are said to."""
    rng = np.random.default_rng(8)
    orthogonal = np.linalg.qr(FITTED)[0]
    processes, errors = [], []
    for _ in range(40):
        noise = long_memory(rng, COUNT)
        processes.append(noise_process(beside_fit(noise), STROKE, TIME, None, fitted=FITTED))
        errors.append(orthogonal.T @ noise)
    memory = np.array([process.memory for process in processes])
    assert np.mean(np.abs(memory) < 4) > 0.7
    together = memory.sum(axis=0)
    assert np.argmax(together) == 4  # the exponent of 0.5
    assert together[4:6].max() - together[:3].max() > 5

    def squares(process: NoiseProcess, error: np.ndarray) -> float:
        """As large as an exponential variable: half of chi-square with two degrees of freedom."""
        covariance = process.score_covariance(orthogonal)
        covariance *= normal_variance(process.effective_degrees_of_freedom(orthogonal))
        return float(error @ np.linalg.solve(covariance, error)) / 2

    alone = [squares(one, error) for one, error in zip(processes, errors, strict=True)]
    beside = [squares(one.beside(together - one.memory), error) for one, error in zip(processes, errors, strict=True)]
    assert np.max(beside) < min(np.max(alone), 10)
    assert 0.5 < np.median(beside) / np.log(2) < 2


@pytest.mark.parametrize("coefficient", [0.0, 0.8])
def test_noise_with_a_short_memory_has_none_together(coefficient: float) -> None:
    rng = np.random.default_rng(1)
    noises = lfilter([1.0], [1.0, -coefficient], rng.standard_normal((8, COUNT + 100)))[:, 100:]
    together = np.sum([noise_process(noise, STROKE, TIME, None).memory for noise in noises], axis=0)
    assert together[0] == 0
    assert np.all(np.diff(together) < 0)
    assert together[4] < -5


def test_long_memory_is_told_beside_resonances() -> None:
    """Two, which take an autoregressive process of order 4."""
    rng = np.random.default_rng(6)
    period = COUNT * 0.1 / 4
    turns = 0.95 * np.exp(1j * np.array([0.6, 1.7]))
    resonances = np.poly(np.concatenate([turns, turns.conj()])).real
    noises = [lfilter([1.0], resonances, long_memory(rng, COUNT + 200))[200:] for _ in range(8)]
    together = np.sum([noise_process(noise, STROKE, TIME, period).memory for noise in noises], axis=0)
    assert together[4] > 3  # 1/f, against none


def test_a_record_that_tells_nothing_stays_as_it_is() -> None:
    short = noise_process(np.random.default_rng(2).standard_normal(60), STROKE[:60], TIME[:60], None)
    assert not short.memory.any()
    np.testing.assert_array_equal(short.beside(50.0 * np.arange(len(short.memory))).spectrum, short.spectrum)
