r"""The noise of a record as a process: how it varies with the signal, and its autoregressive spectrum.

.. math:: S(\omega) = \sigma^2 / |1 + \sum_{k=1}^p a_k e^{-i \omega k}|^2

References
----------
Percival and Walden, "Spectral Analysis for Physical Applications" (1993), ch. 9: Yule-Walker, Whittle's likelihood.
Granger and Joyeux, "An introduction to long-memory time series models", J. Time Series Analysis 1 (1980).
Burnham and Anderson, "Model Selection and Multimodel Inference" (2002), ch. 4: Akaike's weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.optimize import nnls

from mofit._typing import FloatArray
from mofit.data.signals.periodicity import periodic_fit

_TINY = np.finfo(float).tiny
#: Least 1 - 2 d at zero frequency: with d from 0.5 on the mean over the bin would have no end.
_LEAST_SPAN = 0.1


@dataclass(frozen=True)
class SpectrumSettings:
    """How the spectrum of a noise is estimated."""

    highest_order: int = 12
    """Of the autoregressive process: six resonances, two coefficients each."""
    memories: tuple[float, ...] = (0.15, 0.3, 0.45, 0.6)
    """Exponents d of long memory that are tried; 1/f noise has 0.5, and lies between two."""
    memory_order: int = 3
    """Highest order of the autoregressive part beside long memory."""
    memory_bins: int = 64
    """Known bins from which long memory can be told from a short one."""
    bins_per_coefficient: int = 8
    """Known bins that each coefficient needs at least; with fewer it fits chance."""
    fill_rounds: int = 4
    """Rounds of expectation-maximisation, which fill unknown bins with the spectrum found."""
    line: float = 9.0
    """A bin this many times above the noise around it is a line: chance makes one in 8,000. The truncation biases the
    mean of the others by 0.1 %."""
    line_rounds: int = 5
    """Rounds in which lines are left out; each uncovers those that earlier ones had hidden."""
    harmonics: int = 10
    """Harmonics at which the power that repeats is kept."""


SETTINGS = SpectrumSettings()


@dataclass(frozen=True)
class NoiseProcess:
    r"""Noise :math:`e_i = g_i n_i` with a stationary process n of spectrum S."""

    level: FloatArray
    """Level g of the samples, shape (n,), root mean square 1."""
    spectrum: FloatArray
    """S on the bins of the real FFT, shape (n // 2 + 1,); variance of white noise."""
    degrees_of_freedom: FloatArray
    """Of every bin's estimate."""
    harmonics: NDArray[np.int64]
    """Bins of the fundamental and its harmonics; none for records that do not repeat."""
    harmonic_power: FloatArray
    """Power :math:`|R_k|^2 / n` of the whole residual there."""

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.level)

    def score_covariance(self, sensitivities: FloatArray, spectrum: FloatArray | None = None) -> FloatArray:
        r"""Covariance of the score, :math:`J = S^T \Sigma S`, shape (d, d), of sensitivities S (n, d).

        :math:`\Sigma` is taken as circulant between the levels. With ``spectrum`` it is that of a stationary process
        of this spectrum instead.
        """
        columns = sensitivities
        if spectrum is None:
            columns, spectrum = self.level[:, None] * sensitivities, self.spectrum
        bins = np.fft.rfft(columns, axis=0)
        weight = np.full(len(bins), 2.0)
        weight[0] = 1.0
        if len(columns) % 2 == 0:
            weight[-1] = 1.0
        scaled = bins * (weight * spectrum / len(columns))[:, None]
        return np.asarray((bins.conj().T @ scaled).real)

    def effective_degrees_of_freedom(self, sensitivities: FloatArray) -> float:
        """Degrees of freedom of the spectrum where the sensitivities (n, d) have their power."""
        columns = sensitivities / np.maximum(np.linalg.norm(sensitivities, axis=0), 1e-300)
        share = np.sum(np.abs(np.fft.rfft(columns, axis=0)) ** 2, 1) * self.spectrum
        total = share.sum()
        found = total / np.sum(share / self.degrees_of_freedom) if total > 0 else self.degrees_of_freedom.min()
        return float(found)


def noise_process(
    residual: FloatArray,
    signal: FloatArray,
    time: FloatArray,
    period: float | None,
    *,
    without_lines: bool = False,
    taken: FloatArray | float = 0.0,
) -> NoiseProcess:
    r"""Estimate the process from one record.

    What repeats from period to period is subtracted from the residual (`periodic_fit`); the rest is noise, coloured or
    not. Its level follows the signal, :math:`g^2 = a + b |y| + c y^2` with a, b, c not negative (least squares); its
    spectrum is that of an autoregressive process, fitted to the periodogram of e / g without the bins of the period.
    Of a record that does not repeat, the whole residual is noise.

    Parameters
    ----------
    residual, signal, time
        Measured minus simulated, the simulated output, and time in s, of the samples used in the fit, shape (n,).
    period
        In s; None, or less than two of them in the record, if it does not repeat.
    without_lines
        Whether other lines than the period's (mains hum, wheel runout) are left out of the spectrum.
    taken
        Share of the noise's power that a fit has absorbed, on the bins (n // 2 + 1,) or on all.
    """
    count = len(residual)
    step = float((time[-1] - time[0]) / (count - 1))
    periods = count * step / period if period else 0.0
    noise = residual - residual.mean()
    harmonics = np.empty(0, dtype=np.int64)
    if period and periods >= 1.99:
        noise = residual - periodic_fit(time, residual, period)[0]
        harmonics = _bins(periods, SETTINGS.harmonics)
        harmonics = harmonics[harmonics < count // 2]
    level = _level(noise, signal)
    power = np.abs(np.fft.rfft(noise / level)) ** 2 / count / (1 - taken)
    known = np.ones(len(power), dtype=bool)
    known[0] = False
    if len(harmonics):
        every = _bins(periods, int(len(power) / periods))
        known[every[every < len(power)]] = False
    spectrum, freedom = autoregressive_spectrum(power, known, count)
    for _ in range(SETTINGS.line_rounds if without_lines else 0):
        spectrum, freedom = autoregressive_spectrum(power, known & (power < SETTINGS.line * spectrum), count)
    whole = np.abs(np.fft.rfft(residual)) ** 2 / count
    return NoiseProcess(level, spectrum, freedom, harmonics, whole[harmonics])


def effective_samples(residuals: FloatArray) -> float:
    r"""Number of independent residuals in a record.

    .. math:: \nu = \min\!\left(n,\; \frac{4\,(\sum_k S_k)^2}{\sum_k S_k^2}\right)

    with the periodogram :math:`S_k` of the n residuals. For white noise the periodogram is exponentially distributed,
    so that :math:`E\,S^2 = 2 (E\,S)^2` and :math:`\nu \to n`; a residual confined to one line has :math:`\nu = 4`.
    """
    power = np.abs(np.fft.rfft(residuals - residuals.mean())[1:]) ** 2
    total = power.sum()
    if not total > 0:
        return float(len(residuals))
    return float(min(len(residuals), 4 * total**2 / (power**2).sum()))


def autoregressive_spectrum(power: FloatArray, known: NDArray[np.bool_], count: int) -> tuple[FloatArray, FloatArray]:
    r"""Fit processes of order 0 to 12 and average :math:`\log S` over them with Akaike's weights.

    Beside them stand processes with long memory (1/f noise), :math:`|2 \sin(\omega/2)|^{-2d}` times the spectrum of a
    process of low order.

    Parameters
    ----------
    power
        Periodogram :math:`|X_k|^2 / n` on the bins of the real FFT, shape (n // 2 + 1,).
    known
        Bins that are noise alone.
    count
        Number of samples n.

    Returns
    -------
    spectrum
        S on the bins.
    degrees_of_freedom
        Of every bin's estimate, :math:`2 / \mathrm{var}(\log S)`: the variance within a process by Fisher's
        information, and that between them.
    """
    number = int(known.sum())
    if number == 0:
        return np.full(len(power), max(float(power.mean()), _TINY)), np.full(len(power), 2.0)
    highest = max(min(SETTINGS.highest_order, number // SETTINGS.bins_per_coefficient - 1, count // 4), 0)
    turn = np.exp(-2j * np.pi * np.outer(np.arange(len(power)) / count, np.arange(highest + 1)))
    fits = _fits(power, known, turn)
    for exponent in SETTINGS.memories if number >= SETTINGS.memory_bins else ():
        shape = _long_memory(count, exponent)[: len(power)]
        shorter = _fits(power / shape, known, turn[:, : SETTINGS.memory_order + 1])
        logarithm = np.log(shape)
        # one coefficient more, and as many ways for chance as exponents are tried
        offset = float(np.sum(logarithm[known])) + 1 + np.log(len(SETTINGS.memories))
        fits += [_Fit(fit.criterion + offset, fit.logarithm + logarithm, fit.variance) for fit in shorter]
    weights = np.exp(min(fit.criterion for fit in fits) - np.array([fit.criterion for fit in fits]))
    weights /= weights.sum()
    mean, variance = np.zeros(len(power)), np.zeros(len(power))
    for weight, fit in zip(weights, fits, strict=True):
        mean += weight * fit.logarithm
    for weight, fit in zip(weights, fits, strict=True):
        variance += weight * (fit.variance + (fit.logarithm - mean) ** 2)
    return np.exp(mean), np.maximum(2 / np.maximum(variance, 1 / count), 2.0)


@dataclass(frozen=True)
class _Fit:
    """A process: half of Akaike's criterion, log S on the bins, and the variance of that."""

    criterion: float
    logarithm: FloatArray
    variance: FloatArray


def _fits(power: FloatArray, known: NDArray[np.bool_], turn: FloatArray) -> list[_Fit]:
    """Autoregressive processes of every order; ``turn`` is exp(-i omega lag), (bins, lags)."""
    filled, found = np.where(known, power, power[known].mean()), []
    for order in range(turn.shape[1]):
        whitening, spectrum = _fitted(filled, power, known, turn[:, : order + 1])
        slopes = -2 * (turn[:, 1 : order + 1] / whitening[:, None]).real
        derivatives = np.concatenate([np.ones((len(power), 1)), slopes], axis=1)
        information = derivatives[known].T @ derivatives[known]
        criterion = float(np.sum(np.log(spectrum[known]) + power[known] / spectrum[known])) + order + 1
        variance = np.einsum("ki,ij,kj->k", derivatives, np.linalg.pinv(information), derivatives)
        found.append(_Fit(criterion, np.log(spectrum), variance))
    return found


def _long_memory(count: int, exponent: float) -> FloatArray:
    r"""Spectrum :math:`|2 \sin(\omega/2)|^{-2d}` of fractional noise on the bins; the mean over its bin at zero."""
    omega = 2 * np.pi * np.arange(count // 2 + 1) / count
    shape = np.empty(len(omega))
    shape[1:] = (2 * np.sin(omega[1:] / 2)) ** (-2 * exponent)
    shape[0] = (np.pi / count) ** (-2 * exponent) / max(1 - 2 * exponent, _LEAST_SPAN)
    return shape


def _bins(periods: float, number: int) -> NDArray[np.int64]:
    """Bins of the fundamental and its harmonics in a record of so many periods."""
    return np.unique(np.round(periods * np.arange(1, number + 1)).astype(np.int64))


def _fitted(
    filled: FloatArray, power: FloatArray, known: NDArray[np.bool_], turn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Transfer function of the whitening filter, and the spectrum, on the bins; ``turn`` is exp(-i omega lag)."""
    lags = np.ascontiguousarray(turn.real.T)
    for _ in range(SETTINGS.fill_rounds):
        covariance = lags @ filled
        a = solve_toeplitz(covariance[:-1], -covariance[1:]) if len(lags) > 1 else np.empty(0)
        whitening = 1 + turn[:, 1:] @ a
        shape = 1 / np.abs(whitening) ** 2
        spectrum = np.maximum(shape * np.mean(power[known] / shape[known]), _TINY)
        filled = np.where(known, power, spectrum)
    return whitening, spectrum


def _level(noise: FloatArray, signal: FloatArray) -> FloatArray:
    """Standard deviation over the samples, relative to its root mean square.

    A constant level and one that depends on the signal are averaged with Akaike's weights; the likelihood of coloured
    noise counts less. Without the average, chance would make noise grow with the signal, since it cannot make it
    shrink.
    """
    size = np.abs(signal) / max(float(np.max(np.abs(signal))), _TINY)
    squares = noise**2 / max(float(np.mean(noise**2)), _TINY)
    terms = np.stack([np.ones_like(size), size, size**2], axis=1)
    weight = np.ones(len(size))
    for _ in range(3):  # the scatter of a square grows with it
        coefficients, _ = nnls(terms * weight[:, None], squares * weight)
        variance = np.maximum(terms @ coefficients, 1e-2)
        weight = 1 / variance
    variance /= np.mean(variance)
    power = np.abs(np.fft.rfft(noise)) ** 2
    independent = len(noise) * float(np.mean(power)) ** 2 / max(float(np.mean(power**2)), _TINY)
    # of white noise that is n / 2: the mean square of a flat periodogram is twice its squared mean
    gain = min(independent, len(noise) / 2) * float(np.mean(squares - np.log(variance) - squares / variance))
    dependent = 1 / (1 + np.exp(np.clip(2 - gain, -50, 50)))
    return np.asarray(np.sqrt(1 - dependent + dependent * variance))
