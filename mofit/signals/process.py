"""The noise of a record as a process: how it varies with the signal, and its spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from mofit.signals.autoregressive import autoregressive_spectrum
from mofit.signals.waveform import periodic_fit

Array = NDArray[np.float64]

#: Harmonics that are looked at for what repeats.
_HARMONICS = 10
#: A bin this far above the noise around it is a line, not noise: chance makes one in 8,000. Truncation biases the mean
#: of the others by 0.1 %.
_LINE = 9.0
#: Rounds in which lines are taken off; each uncovers those that the ones before it had hidden.
_ROUNDS = 5


@dataclass(frozen=True)
class NoiseProcess:
    r"""Noise :math:`e_i = g_i n_i` with a stationary process n of spectrum S.

    Parameters
    ----------
    level
        g, shape (n,), root mean square 1.
    spectrum
        S on the bins of the real FFT, shape (n // 2 + 1,); variance of white noise.
    freedom
        Degrees of freedom of every bin's estimate.
    lines
        Bins of the fundamental and its harmonics; none for records that do not repeat.
    repeated
        Power :math:`|R_k|^2 / n` of the whole residual there.
    """

    level: Array
    spectrum: Array
    freedom: Array
    lines: NDArray[np.int64]
    repeated: Array

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.level)

    def information(self, slopes: Array, extra: Array | None = None) -> Array:
        r"""Covariance of the score, :math:`J = S^T \Sigma S`, shape (d, d), of sensitivities S (n, d).

        :math:`\Sigma` is taken as circulant between the levels. ``extra`` is a spectrum in place of the noise's own,
        for what is stationary.
        """
        if extra is None:
            columns, spectrum = self.level[:, None] * slopes, self.spectrum
        else:
            columns, spectrum = slopes, extra
        bins = np.fft.rfft(columns, axis=0)
        weight = np.full(len(bins), 2.0)
        weight[0] = 1.0
        if len(slopes) % 2 == 0:
            weight[-1] = 1.0
        scaled = bins * (weight * spectrum / len(slopes))[:, None]
        return np.asarray((bins.conj().T @ scaled).real)

    def typical_freedom(self, slopes: Array) -> float:
        """Degrees of freedom of the spectrum where the sensitivities (n, d) are."""
        power = np.sum(np.abs(np.fft.rfft(slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300), axis=0)) ** 2, 1)
        share = power * self.spectrum
        total = share.sum()
        return float(total / np.sum(share / self.freedom)) if total > 0 else float(self.freedom.min())


def noise_process(
    residual: Array, signal: Array, time: Array, period: float | None, *, without_lines: bool = False
) -> NoiseProcess:
    r"""Estimate the process from one record.

    What repeats from period to period is taken out of the residual (`periodic_fit`); what is left is noise, coloured or
    not. Its level follows the signal, :math:`g^2 = a + b |y| + c y^2` with a, b, c not negative (least squares); its
    spectrum is that of an autoregressive process, fitted to the periodogram of e / g with the bins of the period left
    out. Records that do not repeat count the whole residual as noise.

    Parameters
    ----------
    residual, signal, time
        Measured minus simulated, the simulated output, and time in s, of the judged samples, shape (n,).
    period
        In s; None, or less than two of them in the record, if it does not repeat.
    without_lines
        Whether lines beside the period's (a hum, a wheel out of true) are left out of the spectrum.
    """
    count = len(residual)
    step = float((time[-1] - time[0]) / (count - 1))
    periods = count * step / period if period else 0.0
    noise = residual - residual.mean()
    lines = np.empty(0, dtype=np.int64)
    if period and periods >= 1.99:
        noise = residual - periodic_fit(time, residual, period)[0]
        lines = np.unique(np.round(periods * np.arange(1, _HARMONICS + 1)).astype(np.int64))
        lines = lines[lines < count // 2]
    level = _level(noise, signal)
    power = np.abs(np.fft.rfft(noise / level)) ** 2 / count
    known = np.ones(len(power), dtype=bool)
    known[0] = False
    if len(lines):
        every = np.unique(np.round(periods * np.arange(1, int(len(power) / periods) + 1)).astype(np.int64))
        known[every[every < len(power)]] = False
    spectrum, freedom = autoregressive_spectrum(power, known, count)
    for _ in range(_ROUNDS if without_lines else 0):
        spectrum, freedom = autoregressive_spectrum(power, known & (power < _LINE * spectrum), count)
    whole = np.abs(np.fft.rfft(residual)) ** 2 / count
    return NoiseProcess(level, spectrum, freedom, lines, whole[lines])


def _level(noise: Array, signal: Array) -> Array:
    """Standard deviation over the samples, relative to its root mean square.

    Constant and dependent on the signal are averaged with Akaike's weights, the likelihood of coloured noise being
    worth less: without that, chance would make noise grow with the signal, since it cannot make it shrink.
    """
    size = np.abs(signal) / max(float(np.max(np.abs(signal))), np.finfo(float).tiny)
    squares = noise**2 / max(float(np.mean(noise**2)), np.finfo(float).tiny)
    terms = np.stack([np.ones_like(size), size, size**2], axis=1)
    weight = np.ones(len(size))
    for _ in range(3):  # the scatter of a square grows with it
        coefficients, _ = nnls(terms * weight[:, None], squares * weight)
        variance = np.maximum(terms @ coefficients, 1e-2)
        weight = 1 / variance
    variance /= np.mean(variance)
    power = np.abs(np.fft.rfft(noise)) ** 2
    independent = len(noise) * float(np.mean(power)) ** 2 / max(float(np.mean(power**2)), np.finfo(float).tiny)
    # of white noise that is n / 2, for the mean square of a flat periodogram is twice its squared mean
    gain = min(independent, len(noise) / 2) * float(np.mean(squares - np.log(variance) - squares / variance))
    dependent = 1 / (1 + np.exp(np.clip(2 - gain, -50, 50)))
    return np.asarray(np.sqrt(1 - dependent + dependent * variance))
