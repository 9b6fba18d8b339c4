"""The noise of a record as a process: how it varies with the signal, and its spectrum."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from mofit._typing import FloatArray
from mofit.data.signals.autoregressive import SETTINGS as SPECTRUM
from mofit.data.signals.autoregressive import SpectrumEstimate, autoregressive_spectrum, no_memory
from mofit.data.signals.periodicity import periodic_fit

_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class LineSettings:
    """How lines in the spectrum of a noise are told from it."""

    line: float = 9.0
    """A bin this many times above the noise around it is a line: chance makes one in 8,000. The truncation biases the
    mean of the others by 0.1 %."""
    line_rounds: int = 5
    """Rounds in which lines are left out; each uncovers those that earlier ones had hidden."""
    harmonics: int = 10
    """Harmonics at which the power that repeats is kept."""


LINES = LineSettings()


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
    estimate: SpectrumEstimate | None = None
    """What the spectrum was averaged from, if it was estimated."""

    @property
    def memory(self) -> FloatArray:
        """What this record alone tells of long memory (1/f noise), see `SpectrumEstimate`; zeros if nothing."""
        return self.estimate.memory if self.estimate else no_memory()

    def beside(self, others: FloatArray | float) -> NoiseProcess:
        """The same with what other records of the noise tell of its memory: the sum of theirs."""
        if self.estimate is None:
            return self
        spectrum, freedom = self.estimate.averaged(others)
        return replace(self, spectrum=spectrum, degrees_of_freedom=freedom)

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
    unknown: NDArray[np.bool_] | None = None,
    fitted: FloatArray | None = None,
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
    unknown
        Bins that may hold more than noise, (n // 2 + 1,): the spectrum there follows from the others.
    fitted
        Signals (n, d) whose coefficients were fitted, in a record that does not repeat: the spectrum is that of the
        noise before the fit (`mofit.data.signals.contrasts`).
    """
    count = len(residual)
    step = float((time[-1] - time[0]) / (count - 1))
    periods = count * step / period if period else 0.0
    noise = residual - residual.mean()
    harmonics = np.empty(0, dtype=np.int64)
    if period and repeats(periods):
        noise = residual - periodic_fit(time, residual, period)[0]
        harmonics = _bins(periods, LINES.harmonics)
        harmonics = harmonics[harmonics < count // 2]
    level = _level(noise, signal)
    lines = np.fft.rfft(noise / level) / np.sqrt(count * (1 - taken))
    beside = None
    if fitted is not None and not len(harmonics):
        beside = np.fft.rfft(fitted / level[:, None], axis=0) / np.sqrt(count)
    power = np.abs(lines) ** 2
    known = np.ones(len(power), dtype=bool) if unknown is None else ~unknown
    known[0] = False
    if len(harmonics):
        every = _bins(periods, int(len(power) / periods))
        known[every[every < len(power)]] = False
    # what a record that does not repeat holds of the model's error has resonances, too
    highest = SPECTRUM.highest_order if len(harmonics) else SPECTRUM.memory_order_of_rest
    estimate = autoregressive_spectrum(lines, known, count, beside, highest)
    used = known
    for _ in range(LINES.line_rounds if without_lines else 0):
        quiet = known & (power < LINES.line * estimate.averaged()[0])
        if np.array_equal(quiet, used):
            break
        used = quiet
        estimate = autoregressive_spectrum(lines, used, count, beside, highest)
    whole = np.abs(np.fft.rfft(residual)) ** 2 / count
    return NoiseProcess(level, *estimate.averaged(), harmonics, whole[harmonics], estimate)


def repeats(periods: float) -> bool:
    """Whether a record of so many periods tells noise from what repeats: two, but for rounding."""
    return periods >= 1.99


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


def _bins(periods: float, number: int) -> NDArray[np.int64]:
    """Bins of the fundamental and its harmonics in a record of so many periods."""
    return np.unique(np.round(periods * np.arange(1, number + 1)).astype(np.int64))


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
