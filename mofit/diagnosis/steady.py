"""Lines of one frequency in all tests, whatever excites them: a hum, a gear, a fan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from mofit.diagnosis.whitening import Whitening

Array = NDArray[np.float64]

#: Chance below which a frequency counts as a line, corrected for the number of frequencies looked at.
_CHANCE = 1e-4
#: Most frequencies that are looked for.
_MOST = 6
#: Lines on each side that the leakage of a frequency reaches.
_NEAR = 1.5
#: Free records that are counted at least: where a frequency has next to none, chance is not told from too few.
_LEAST = 0.5
#: Lines on each side over which an interpolated spectrum is gathered.
_REACH = 8


def steady_lines(
    records: Sequence[Whitening], rows: Sequence[Array], free: Sequence[NDArray[np.bool_]]
) -> list[NDArray[np.bool_]]:
    """Which lines of each record belong to a frequency that stands out of the noise in all records together.

    Parameters
    ----------
    records
        Of all tests.
    rows
        White rows of what does not repeat, per record.
    free
        Lines of each record that hold nothing but noise if there is no such frequency, (lines,).

    Returns
    -------
    list
        Per record, a subset of ``free``.
    """
    found = [np.zeros_like(part) for part in free]
    for _ in range(_MOST):
        highest = highest_frequency(records, rows, [here & ~there for here, there in zip(free, found, strict=True)])
        if highest is None or highest.chance > _CHANCE:
            break
        for mine, here, near in zip(found, free, highest.near(records), strict=True):
            mine |= near & here
    return found


@dataclass(frozen=True)
class Peak:
    """The frequency that stands out most.

    Parameters
    ----------
    frequency
        In Hz.
    power, freedom
        Summed white power there, and its expectation of noise.
    chance
        Of so much, corrected for the number of frequencies looked at (Bonferroni).
    """

    frequency: float
    power: float
    freedom: float
    chance: float

    def near(self, records: Sequence[Whitening]) -> list[NDArray[np.bool_]]:
        """Which lines of each record its leakage reaches: none of a record that does not repeat."""
        return [
            (np.abs(np.arange(w.count // 2 + 1) - self.frequency * w.count * w.step) < _NEAR) & (w.periods > 0)
            for w in records
        ]


def highest_frequency(
    records: Sequence[Whitening], rows: Sequence[Array], kept: Sequence[NDArray[np.bool_]]
) -> Peak | None:
    r"""The frequency at which some lines of all records that repeat have the least likely power; None without any.

    At every frequency the white power of the records that repeat is summed. The spectra are interpolated
    (zero-padding), so that a frequency between two lines is seen as well; of noise, record t then has the power
    :math:`2 w_t(f)` there, where :math:`w_t` is 1 far from lines that are not kept, and 0 on them. Without a line the
    sum is about :math:`\chi^2_\nu`, with :math:`\nu = 2 (\sum w_t)^2 / \sum w_t^2`; the noise being estimated, F.

    Parameters as of `steady_lines`, with ``kept`` for ``free``.
    """
    places = [i for i, w in enumerate(records) if w.periods]
    if not places:
        return None
    highest = min(records[i].frequencies[-1] for i in places)
    longest = max(records[i].count * records[i].step for i in places)
    grid = np.arange(1, int(2 * longest * highest)) / (2 * longest)
    freedom = np.array([float(np.median(records[i].process.freedom)) for i in places])
    power = np.array([_power_at(records[i], rows[i], kept[i], grid) for i in places]).sum(axis=0)
    weight = np.array([_weight_at(records[i], kept[i], grid) for i in places])
    total = np.maximum(weight.sum(axis=0), _LEAST)
    squares = np.maximum(np.sum(weight**2, axis=0), _LEAST**2)
    behind = total**2 / np.maximum(np.sum(weight**2 / freedom[:, None], axis=0), _LEAST**2 / freedom.max())
    chance = fisher.sf(power / (2 * total), 2 * total**2 / squares, behind)
    best = int(np.argmin(chance))
    return Peak(
        float(grid[best]), float(power[best]), float(2 * total[best]), min(1.0, float(chance[best] * len(grid)))
    )


def _power_at(w: Whitening, rows: Array, kept: NDArray[np.bool_], grid: Array) -> Array:
    """White power of some lines at frequencies, twice the number of lines apart: 2 on average without a signal."""
    signal = np.fft.irfft(np.where(kept, w.white_lines(rows), 0.0), w.count)
    fine = np.fft.rfft(signal, 2 * w.count)
    place = np.round(grid * 2 * w.count * w.step).astype(np.int64)
    return np.asarray(np.abs(fine[np.minimum(place, len(fine) - 1)]) ** 2)


def _weight_at(w: Whitening, kept: NDArray[np.bool_], grid: Array) -> Array:
    """The power that `_power_at` finds of noise, halved: of lines with sinc² of the distance."""
    fine = np.zeros(2 * len(kept))
    fine[::2] = kept
    kernel = np.sinc(np.arange(-2 * _REACH, 2 * _REACH + 1) / 2) ** 2
    weight = np.convolve(fine, kernel, "same")
    place = np.round(grid * 2 * w.count * w.step).astype(np.int64)
    return np.asarray(weight[np.minimum(place, 2 * (len(kept) - 1))])
