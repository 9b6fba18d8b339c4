"""Records made white: the noise of a test, and its signals as independent rows of unit variance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mofit.signals import NoiseProcess, Record, noise_process, periodic_fit

Array = NDArray[np.float64]

#: Periods from which on what repeats can be told from what does not.
FEWEST_PERIODS = 1.99


@dataclass(frozen=True)
class Whitening:
    r"""Noise :math:`e_i = g_i n_i` of one output of one test; n is stationary with spectrum S.

    Rows are the lines of the real FFT of :math:`x / g`, real and imaginary part, each scaled to unit variance of the
    noise: :math:`\sqrt{2 / (n S_k)}`, at zero frequency :math:`\sqrt{1 / (n S_0)}`. Sums of squares are those of
    generalised least squares.

    Parameters
    ----------
    start
        First of the record's samples that is used.
    step
        Sampling interval, s.
    periods
        Whole periods in the samples used; 0 if the test does not repeat.
    period
        In s; nan if the test does not repeat.
    process
        The noise.
    """

    start: int
    step: float
    periods: int
    period: float
    process: NoiseProcess

    def with_discrepancy(self, mean_square: float, lines: NDArray[np.bool_], more: NDArray[np.bool_]) -> Whitening:
        """The same with an unknown signal counted as noise: of this mean square, spread evenly over ``lines``.

        Each line of ``more`` has as much as one of those.
        """
        level = self.count * mean_square / max(int(np.sum(lines[self.line_of_row])), 1)
        extra = np.where(lines | more, level, 0.0)
        return replace(self, process=replace(self.process, spectrum=self.process.spectrum + extra))

    @property
    def count(self) -> int:
        """Number of samples used, n."""
        return self.process.count

    @property
    def frequencies(self) -> Array:
        """Of the lines, Hz, shape (n // 2 + 1,)."""
        return np.arange(self.count // 2 + 1) / (self.count * self.step)

    @property
    def harmonic(self) -> NDArray[np.bool_]:
        """Which lines are harmonics of the test's period, zero included, shape (n // 2 + 1,); none without a period."""
        number = np.arange(self.count // 2 + 1)
        return np.asarray(number % self.periods == 0) if self.periods else np.zeros(len(number), dtype=bool)

    @cached_property
    def _scale(self) -> Array:
        weight = np.full(self.count // 2 + 1, 2.0)
        weight[0] = 1.0
        if self.count % 2 == 0:
            weight[-1] = 1.0
        return np.sqrt(weight / (self.count * self.process.spectrum))

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """Which of the real and imaginary parts are not identically zero."""
        lines = self.count // 2 + 1
        parts = np.ones(2 * lines, dtype=bool)
        parts[lines] = False
        parts[-1] &= self.count % 2 == 1
        return np.flatnonzero(parts)

    @property
    def line_of_row(self) -> NDArray[np.intp]:
        """Line of every row, shape (rows,)."""
        return self._rows % (self.count // 2 + 1)

    def used(self, columns: Array) -> Array:
        """The used samples of signals (..., samples, k)."""
        return np.asarray(columns[..., self.start : self.start + self.count, :])

    def rows(self, columns: Array) -> Array:
        """Signals (..., samples, k) of the whole record as white rows (..., rows, k)."""
        scaled = np.moveaxis(self.used(columns), -2, -1) / self.process.level
        lines = fft.rfft(scaled, axis=-1) * self._scale
        return np.moveaxis(np.concatenate([lines.real, lines.imag], axis=-1)[..., self._rows], -1, -2)

    def white_lines(self, rows: Array) -> NDArray[np.complex128]:
        """Rows of one signal (rows,) as complex lines (n // 2 + 1,)."""
        lines = self.count // 2 + 1
        parts = np.zeros(2 * lines)
        parts[self._rows] = rows
        return np.asarray(parts[:lines] + 1j * parts[lines:])

    def noise_rows(self, columns: Array) -> Array:
        """Rows of what does not repeat in signals (samples, k), leakage of a period between samples included."""
        noise = np.array(columns)
        time = self.step * np.arange(self.count, dtype=np.float64)
        for k in range(noise.shape[1] if self.periods else 0):
            used = noise[self.start : self.start + self.count, k]
            used -= periodic_fit(time, used, self.period)[0]
        return self.rows(noise)

    def signal(self, rows: Array) -> Array:
        """The inverse of `rows`, for one signal: (rows,) to the used samples (n,)."""
        return np.asarray(fft.irfft(self.white_lines(rows) / self._scale, self.count) * self.process.level)


def whitening(measured: Array, used: NDArray[np.bool_], step: float, record: Record, noise_sd: float) -> Whitening:
    """Of one output of one test, from the data alone, so that all models are judged alike.

    A test of at least two periods is cut to whole ones, and its noise is what does not repeat; lines that stand out of
    it do not count. Of another test the noise is taken as white, at the level found by smoothing.

    Parameters
    ----------
    measured
        Output, shape (samples,).
    used
        Which samples are judged: a contiguous part.
    step
        Sampling interval, s.
    record
        What the test's data say.
    noise_sd
        Of the output, in its unit, for a test that does not repeat.
    """
    place = np.flatnonzero(used)
    start, count = int(place[0]), len(place)
    periods = count * step / record.period if record.period else 0.0
    if record.period is None or periods < FEWEST_PERIODS:
        spectrum = np.full(count // 2 + 1, max(noise_sd, np.finfo(float).tiny ** 0.25) ** 2)
        process = NoiseProcess(
            np.ones(count), spectrum, np.full(len(spectrum), float(count) / 2), np.empty(0, dtype=np.int64), np.empty(0)
        )
        return Whitening(start, step, 0, float("nan"), process)
    # half a sample of tolerance is for records cut to whole periods
    whole = int(periods + 0.5 * step / record.period)
    count = min(round(whole * record.period / step), count)
    values, time = measured[start : start + count], np.asarray(step * np.arange(count), dtype=np.float64)
    waveform, _ = periodic_fit(time, values, record.period)
    process = noise_process(values, waveform, time, record.period, without_lines=True)
    return Whitening(start, step, whole, record.period, process)
