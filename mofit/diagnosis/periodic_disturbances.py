"""Sinusoids of one frequency in all tests, whatever excites them: mains, a gear, a fan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from mofit._typing import FloatArray
from mofit.diagnosis.settings import SpectralSettings
from mofit.diagnosis.whitening import Whitening

#: Records that are counted at least: where a frequency has almost no free line, p needs a finite denominator.
_LEAST = 0.5
#: Lines on each side over which an interpolated spectrum is gathered: sinc² is below 0.2 % there.
_REACH = 8


def interference_lines(
    records: Sequence[Whitening],
    rows: Sequence[FloatArray],
    free: Sequence[NDArray[np.bool_]],
    settings: SpectralSettings,
) -> list[NDArray[np.bool_]]:
    """Which lines of each record belong to a frequency that exceeds the noise of all records together.

    Parameters
    ----------
    records
        Of all tests.
    rows
        Whitened aperiodic part of each record.
    free
        Lines of each record that hold nothing but noise if there is no such frequency, (lines,).
    settings
        Significance and number of frequencies.

    Returns
    -------
    list
        Per record, a subset of ``free``.
    """
    found = [np.zeros_like(part) for part in free]
    for _ in range(settings.interference_frequencies):
        peak = highest_frequency(records, rows, [here & ~there for here, there in zip(free, found, strict=True)])
        if peak is None or peak.p_value > settings.interference_p_value:
            break
        for mine, here, near in zip(found, free, peak.near(records, settings.leakage), strict=True):
            mine |= near & here
    return found


@dataclass(frozen=True)
class Peak:
    """The frequency with the least probable power.

    Parameters
    ----------
    frequency
        In Hz.
    power, degrees_of_freedom
        Summed whitened power there, and its expectation for noise.
    p_value
        Corrected for the number of frequencies (Bonferroni).
    """

    frequency: float
    power: float
    degrees_of_freedom: float
    p_value: float

    def near(self, records: Sequence[Whitening], leakage: float) -> list[NDArray[np.bool_]]:
        """Which lines of each record its leakage reaches: none of a record that does not repeat."""
        return [
            (np.abs(np.arange(w.count // 2 + 1) - self.frequency * w.count * w.step) < leakage) & (w.periods > 0)
            for w in records
        ]


def highest_frequency(
    records: Sequence[Whitening], rows: Sequence[FloatArray], kept: Sequence[NDArray[np.bool_]]
) -> Peak | None:
    r"""The frequency at which some lines of all periodic records have the least probable power; None without any.

    At every frequency the whitened power of the periodic records is summed. The spectra are interpolated
    (zero-padding), so that a frequency between two lines is seen as well; of noise, record t then has the power
    :math:`2 w_t(f)` there, where :math:`w_t` is 1 far from lines that are not kept, and 0 on them. Without a sinusoid
    the sum is about :math:`\chi^2_\nu`, with :math:`\nu = 2 (\sum w_t)^2 / \sum w_t^2`; as the noise is estimated, the
    test is an F test.

    Parameters as of `interference_lines`, with ``kept`` for ``free``.
    """
    places = [i for i, w in enumerate(records) if w.periods]
    if not places:
        return None
    highest = min(records[i].frequencies[-1] for i in places)
    longest = max(records[i].count * records[i].step for i in places)
    grid = np.arange(1, int(2 * longest * highest)) / (2 * longest)
    freedom = np.array([float(np.median(records[i].process.degrees_of_freedom)) for i in places])
    power = np.array([_power_at(records[i], rows[i], kept[i], grid) for i in places]).sum(axis=0)
    weight = np.array([_weight_at(records[i], kept[i], grid) for i in places])
    total = np.maximum(weight.sum(axis=0), _LEAST)
    squares = np.maximum(np.sum(weight**2, axis=0), _LEAST**2)
    behind = total**2 / np.maximum(np.sum(weight**2 / freedom[:, None], axis=0), _LEAST**2 / freedom.max())
    p = fisher.sf(power / (2 * total), 2 * total**2 / squares, behind)
    best = int(np.argmin(p))
    return Peak(float(grid[best]), float(power[best]), float(2 * total[best]), min(1.0, float(p[best] * len(grid))))


def _power_at(w: Whitening, rows: FloatArray, kept: NDArray[np.bool_], grid: FloatArray) -> FloatArray:
    """Whitened power of some lines at frequencies half a line apart: 2 on average without a signal."""
    signal = np.fft.irfft(np.where(kept, w.white_lines(rows), 0.0), w.count)
    fine = np.fft.rfft(signal, 2 * w.count)
    place = np.round(grid * 2 * w.count * w.step).astype(np.int64)
    return np.asarray(np.abs(fine[np.minimum(place, len(fine) - 1)]) ** 2)


def _weight_at(w: Whitening, kept: NDArray[np.bool_], grid: FloatArray) -> FloatArray:
    """Half the power that `_power_at` expects of noise: of lines with sinc² of the distance."""
    fine = np.zeros(2 * len(kept))
    fine[::2] = kept
    kernel = np.sinc(np.arange(-2 * _REACH, 2 * _REACH + 1) / 2) ** 2
    weight = np.convolve(fine, kernel, "same")
    place = np.round(grid * 2 * w.count * w.step).astype(np.int64)
    return np.asarray(weight[np.minimum(place, 2 * (len(kept) - 1))])
