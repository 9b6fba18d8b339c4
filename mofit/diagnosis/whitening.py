"""Whitening of one record: its signals as independent rows with noise of unit variance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mofit._typing import FloatArray
from mofit.data.signals import NoiseProcess, SignalAnalysis, noise_process, periodic_fit
from mofit.diagnosis.causal_filter import CausalFilter

#: Periods from which on what repeats can be told from noise: two, less the rounding of the record's length.
_FEWEST_PERIODS = 1.99
#: Share of their length by which a few periods may miss whole samples, and still repeat well enough to start from.
_MISSED = 1e-3
#: Share of a record at the end of which a few periods of it may lie: a model settles later than the rig may have.
_SETTLING = 0.125
#: Share of the power of a signal that repeats which may lie beside its harmonics: noise of an input.
ELSEWHERE = 0.01


@dataclass(frozen=True)
class Whitening:
    r"""Noise :math:`e_i = g_i n_i` of one output of one test; n is stationary with spectrum S.

    Rows are the lines of the real FFT of :math:`x / g`, real and imaginary part, each scaled to unit variance of the
    noise: :math:`\sqrt{2 / (n S_k)}`, at zero frequency :math:`\sqrt{1 / (n S_0)}`. Sums of squares are those of
    generalised least squares. A record that does not repeat is whitened before by the causal filter of S (see
    `CausalFilter`): the FFT would take the step from its end to its start for a part of the signal.

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
        """The same with an unknown signal of this mean square counted as noise, its power equal on all ``lines``.

        Each line of ``more`` gets as much power as one of those.
        """
        level = self.count * mean_square / max(int(np.sum(lines[self.line_of_row])), 1)
        extra = np.where(lines | more, level, 0.0)
        return replace(self, process=replace(self.process, spectrum=self.process.spectrum + extra))

    @property
    def count(self) -> int:
        """Number of samples used, n."""
        return self.process.count

    @property
    def frequencies(self) -> FloatArray:
        """Of the lines, Hz, shape (n // 2 + 1,)."""
        return np.arange(self.count // 2 + 1) / (self.count * self.step)

    @property
    def harmonic(self) -> NDArray[np.bool_]:
        """Which lines are harmonics of the test's period, zero included, shape (n // 2 + 1,); none without a period."""
        number = np.arange(self.count // 2 + 1)
        return np.asarray(number % self.periods == 0) if self.periods else np.zeros(len(number), dtype=bool)

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the noise about its level over the samples used, in the output's unit.

        With a long memory (1/f) the level itself would move by as much.
        """
        variance = np.average(self.process.spectrum[1:], weights=self._weight[1:]) * np.mean(self.process.level**2)
        return float(np.sqrt(variance))

    @property
    def _weight(self) -> FloatArray:
        """How often every line counts among the real ones."""
        weight = np.full(self.count // 2 + 1, 2.0)
        weight[0] = 1.0
        if self.count % 2 == 0:
            weight[-1] = 1.0
        return weight

    @cached_property
    def _scale(self) -> FloatArray:
        return np.sqrt(self._weight / (self.count * (self.process.spectrum if self.periods else 1.0)))

    @cached_property
    def _filter(self) -> CausalFilter:
        return CausalFilter.whitening(self.process.spectrum, self.count)

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """Which of the real and imaginary parts are not identically zero."""
        lines = self.count // 2 + 1
        return np.delete(np.arange(2 * lines), [lines] if self.count % 2 else [lines, -1])

    @property
    def line_of_row(self) -> NDArray[np.intp]:
        """Line of every row, shape (rows,)."""
        return self._rows % (self.count // 2 + 1)

    def rows(self, columns: FloatArray) -> FloatArray:
        """Signals (..., samples, k) of the whole record as white rows (..., rows, k)."""
        used = columns[..., self.start : self.start + self.count, :]
        scaled = np.moveaxis(used, -2, -1) / self.process.level
        if not self.periods:
            scaled = self._filter.apply(scaled)
        lines, number = fft.rfft(scaled, axis=-1), self.count // 2 + 1
        # in the order of `_rows`: the constant has no imaginary part, nor has the last of an even count
        imaginary = slice(1, self.count - self.count // 2)
        parts = np.empty((*lines.shape[:-1], len(self._rows)))
        np.multiply(lines.real, self._scale, out=parts[..., :number])
        np.multiply(lines.imag[..., imaginary], self._scale[imaginary], out=parts[..., number:])
        return np.moveaxis(parts, -1, -2)

    def of_few_periods(self) -> Whitening:
        """The same over the fewest periods that fill whole samples; itself for a record that does not repeat.

        Of a signal that repeats the rows of the harmonics are the same, up to rounding of periods to samples, and the
        others are zero.
        """
        if not self.periods:
            return self
        samples = np.arange(1, self.periods + 1) * self.period / self.step
        missed = np.abs(samples - np.round(samples)) / samples
        periods = 1 + int(np.argmax(missed <= max(_MISSED, missed.min())))
        count, old = min(round(float(samples[periods - 1])), self.count), self.process
        later = min(max(int(_SETTLING * self.count) - count, 0), self.count - count)
        lines = np.arange(count // 2 + 1) / count
        spectrum = np.interp(lines, np.arange(len(old.spectrum)) / self.count, old.spectrum) * count / self.count
        process = replace(old, level=old.level[later : later + count], spectrum=spectrum)
        return replace(self, start=self.start + later, periods=periods, process=process)

    def rows_among(self, whole: Whitening) -> NDArray[np.intp]:
        """Of a few periods: where every row is among those of all, (rows,); -1 beside the harmonics."""
        number, length = self.line_of_row, whole.count // 2 + 1
        harmonic, beside = np.divmod(number, self.periods)
        line, imaginary = harmonic * whole.periods, np.arange(len(number)) >= self.count // 2 + 1
        place = np.searchsorted(whole._rows, line + imaginary * length)
        known = (beside == 0) & (line < length) & (place < len(whole._rows))
        place = np.where(known, place, -1)
        return np.where(whole._rows[place] == line + imaginary * length, place, -1)

    def repeated(self, whole: Whitening, rows: FloatArray) -> FloatArray:
        """Rows (..., rows) of a few periods as those (..., m) of all, of a signal that repeats."""
        harmonics = self.white_lines(rows)[..., :: self.periods]
        number = min(harmonics.shape[-1], len(whole.frequencies[:: whole.periods]))
        later = (self.start - whole.start) * self.step / self.period
        lines = np.zeros((*rows.shape[:-1], len(whole.frequencies)), dtype=complex)
        turned = harmonics[..., :number] * np.exp(-2j * np.pi * later * np.arange(number))
        lines[..., : number * whole.periods : whole.periods] = turned
        return np.concatenate([lines.real, lines.imag], axis=-1)[..., whole._rows]

    def waveform(self, rows: FloatArray) -> FloatArray:
        """What repeats of a signal, from its rows (rows,), as the used samples (n,)."""
        time = self.step * np.arange(self.count, dtype=np.float64)
        return periodic_fit(time, self.signal(rows), self.period)[0]

    def repeats(self, signals: FloatArray) -> bool:
        """Whether signals (samples, k) have hardly any power beside the harmonics; true of any in a test without."""
        if not self.periods:
            return True
        power = np.abs(fft.rfft(signals[self.start : self.start + self.count], axis=0)) ** 2
        power[0] = 0.0
        return bool(np.all(power[~self.harmonic].sum(axis=0) <= ELSEWHERE * power.sum(axis=0)))

    def white_lines(self, rows: FloatArray) -> NDArray[np.complex128]:
        """Rows of signals (..., rows) as complex lines (..., n // 2 + 1)."""
        lines = self.count // 2 + 1
        found = np.zeros((*rows.shape[:-1], lines), dtype=complex)
        found.real = rows[..., :lines]
        found.imag[..., 1 : rows.shape[-1] - lines + 1] = rows[..., lines:]
        return found

    def noise_rows(self, values: FloatArray) -> FloatArray:
        """Rows of the aperiodic part of a signal (samples,), whatever number of samples a period has."""
        noise = np.array(values)
        if self.periods:
            used = noise[self.start : self.start + self.count]
            used -= periodic_fit(self.step * np.arange(self.count, dtype=np.float64), used, self.period)[0]
        return self.rows(noise[:, None])[:, 0]

    def signal(self, rows: FloatArray) -> FloatArray:
        """The inverse of `rows`: white rows (..., rows) of signals as their used samples (..., n)."""
        values = fft.irfft(self.white_lines(rows) / self._scale, self.count)
        return np.asarray((values if self.periods else self._filter.undo(values)) * self.process.level)


def whitening(
    measured: FloatArray,
    used: NDArray[np.bool_],
    step: float,
    analysis: SignalAnalysis,
    noise_sd: float,
    known: NoiseProcess | None = None,
) -> Whitening:
    """Of one output of one test, from the data alone, so that all models are compared with the same noise.

    A test of at least two periods is cut to whole ones, and its noise is what does not repeat; lines that exceed it do
    not count. The noise of another test is taken as white, at the level found by smoothing, until it is known.

    Parameters
    ----------
    measured, used
        Output, and which samples are used, a contiguous part; (samples,).
    step
        Sampling interval, s.
    analysis
        Period of the test.
    noise_sd
        Of the output, in its unit, for a test that does not repeat.
    known
        Its noise, once there is a fit (`mofit.diagnosis.input_prediction`).
    """
    place = np.flatnonzero(used)
    start, count = int(place[0]), len(place)
    periods = count * step / analysis.period if analysis.period else 0.0
    if analysis.period is None or periods < _FEWEST_PERIODS:
        spectrum = np.full(count // 2 + 1, max(noise_sd, np.finfo(float).tiny ** 0.25) ** 2)
        freedom = np.full(len(spectrum), float(count) / 2)
        flat = NoiseProcess(np.ones(count), spectrum, freedom, np.empty(0, dtype=np.int64), np.empty(0))
        return Whitening(start, step, 0, float("nan"), known or flat)
    # half a sample of tolerance is for records cut to whole periods
    whole = int(periods + 0.5 * step / analysis.period)
    count = min(round(whole * analysis.period / step), count)
    values, time = measured[start : start + count], np.asarray(step * np.arange(count), dtype=np.float64)
    waveform, _ = periodic_fit(time, values, analysis.period)
    process = noise_process(values, waveform, time, analysis.period, without_lines=True)
    return Whitening(start, step, whole, analysis.period, process)
