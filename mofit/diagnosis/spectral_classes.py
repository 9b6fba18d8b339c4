"""Classes of spectral lines: which may hold which kind of discrepancy, and interference that all tests share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.diagnosis.whitening import Whitening

#: Harmonics with a class of their own where the excitation is a sine; higher ones hold too little of a smooth effect.
HARMONICS = 10
#: Excited lines that a smooth effect combines at most: a cubic one three.
ORDER = 3
#: Odd multiples of half the excitation's frequency with a class of their own.
SUBHARMONICS = 3
#: Lines on each side that a frequency between two lines reaches: the main lobe of a rectangular window, nearly.
_LEAKAGE = 1.5
#: Lines on each side of the excitation that a slow change of gain fills.
_MODULATION = 2
#: Share of an input's power that its excited lines hold; what is weaker moves no output beyond noise.
_EXCITED_POWER = 0.999
#: Share of it below the lower edge of the band.
_LOWER_EDGE = 0.05
#: Radius of the test drum, m, where a campaign does not state ``drum_radius``: 4.35 Hz at 60 km/h.
_DRUM_RADIUS = 0.61
#: p-value below which a frequency common to all tests counts as interference, corrected for all frequencies.
_INTERFERENCE_P_VALUE = 1e-4
#: Most such frequencies: a mains frequency, its multiples and a gear.
_INTERFERENCE_FREQUENCIES = 6
#: Records that are counted at least: where a frequency has almost no free line, p needs a finite denominator.
_LEAST = 0.5
#: Lines on each side over which an interpolated spectrum is gathered: sinc² is below 0.2 % there.
_REACH = 8


@dataclass(frozen=True)
class SpectralClass:
    """A class of spectral lines: its name in JSON, the head of its column in a residual map, and a phrase."""

    name: str
    label: str
    phrase: str


#: A line belongs to the first class that holds it.
SPECTRAL_CLASSES = (
    SpectralClass("dc", "constant", "the constant"),
    SpectralClass("odd", "odd", "odd harmonics"),
    SpectralClass("even", "even", "even harmonics"),
    SpectralClass("subharmonic", "half", "subharmonics"),
    SpectralClass("rotating", "rotating\nparts", "rotational orders"),
    SpectralClass("slow", "slow", "slow changes"),
    SpectralClass("steady", "inter-\nference", "sinusoidal interference"),
    SpectralClass("excited", "excited", "the excited band"),
    SpectralClass("other", "other", "other lines"),
)
CLASS_INDEX = {one.name: index for index, one in enumerate(SPECTRAL_CLASSES)}


def classify(w: Whitening, excitation: FloatArray, orders: Mapping[str, float]) -> NDArray[np.int64]:
    """Class of every line of a record, but for interference, which all tests together show; (lines,).

    Parameters
    ----------
    w
        Of the record.
    excitation
        The exciting input over the samples used, (n,).
    orders
        Frequencies of what rotates, Hz; see `rotational_orders`.

    Returns
    -------
    Indices into `SPECTRAL_CLASSES`: *dc*, zero frequency; *odd* and *even* harmonics of the excitation's period, up to
    the tenth and to three times the highest one excited; *subharmonic*, odd multiples of half its frequency, up to the
    fifth; *rotating*, the orders and their sidebands at ± the excitation; *slow*, below half the excitation's
    frequency, and two lines on each side of it; *excited*, without a period: lines that the input excites, and their
    harmonics, see `highest_answering`; *other*, noise in every model.
    """
    m, number = w.periods, np.arange(len(w.frequencies))
    nowhere = np.zeros(len(number), dtype=bool)
    low = w.harmonic & (number <= highest_harmonic(excitation, m) * m)
    odd_harmonic = number // max(m, 1) % 2 == 1
    away = np.abs(number - m)
    slow = (number < m / 2) | ((away <= _MODULATION) & (away < m / 2)) if m else nowhere
    excited = nowhere if m else number <= highest_answering(excitation)
    place = [w.count * w.step * f + sideband * m for f in orders.values() for sideband in ((-1, 0, 1) if m else (0,))]
    near = np.any([nowhere, *(np.abs(number - line) < _LEAKAGE for line in place)], axis=0)
    found = {
        "dc": number == 0,
        "odd": low & odd_harmonic,
        "even": low & ~odd_harmonic,
        "subharmonic": _subharmonic(number, m) if m > 2 else nowhere,
        "rotating": near & ~slow & ~excited,
        "slow": slow,
        "excited": excited,
    }
    return np.select(list(found.values()), [CLASS_INDEX[name] for name in found], CLASS_INDEX["other"])


def _subharmonic(number: NDArray[np.int64], periods: int) -> NDArray[np.bool_]:
    half = 2 * number / periods
    # of an odd number of periods the two lines beside
    nearest = np.abs(half - (2 * np.round((half - 1) / 2) + 1)) < 1.5 / periods
    return np.asarray(nearest & (half < 2 * SUBHARMONICS))


def highest_harmonic(excitation: FloatArray, periods: int) -> int:
    """The highest harmonic of a periodic input (n,) that may hold a gap.

    A multisine excites many: a gap lies on their lines, and on sums and differences of up to three of them.
    """
    return max(HARMONICS, ORDER * highest_excited(excitation, periods))


def highest_answering(excitation: FloatArray) -> int:
    """The highest line of an input (n,) that does not repeat on which a gap may lie.

    A sparsely filled band counts as a whole, harmonics of its lines fall between them: up to twice the highest line
    that it excites, or to the tenth harmonic of its lower edge where it is narrow, as that of a sine which ramps.
    """
    power = np.cumsum(_power(excitation))
    return max(2 * highest_excited(excitation), HARMONICS * int(np.searchsorted(power, _LOWER_EDGE * power[-1])))


def highest_excited(excitation: FloatArray, periods: int = 1) -> int:
    """The highest line that the input's power reaches: of a periodic one, the highest harmonic."""
    power = _power(excitation, periods)
    order = np.argsort(-power, kind="stable")
    most = int(np.searchsorted(np.cumsum(power[order]), _EXCITED_POWER * power.sum())) + 1
    return int(order[:most].max())


def _power(excitation: FloatArray, periods: int = 1) -> FloatArray:
    """Of an input's lines; of a periodic one, of its harmonics."""
    return np.asarray(np.abs(np.fft.rfft(excitation - excitation.mean())[:: max(periods, 1)]) ** 2)


def rotational_orders(measurement: Measurement) -> dict[str, float]:
    r"""Frequencies [Hz] of what rotates: of the wheel, :math:`v / 2 \pi r`, of the drum under it, and of a shaft.

    From the conditions ``longitudinal_velocity``, ``dynamic_rolling_radius`` and ``drum_radius``, and from
    ``rotational_speed`` [rad/s]; none without them.
    """
    conditions = measurement.experiment.conditions
    shaft = abs(conditions.get("rotational_speed", 0.0))
    turning = {"shaft": shaft / (2 * np.pi)} if shaft else {}
    speed = abs(conditions.get("longitudinal_velocity", 0.0))
    radius = conditions.get("dynamic_rolling_radius", 0.0)
    if not (speed > 0 and radius > 0):
        return turning
    drum = conditions.get("drum_radius", _DRUM_RADIUS)
    return {"wheel": speed / (2 * np.pi * radius), "drum": speed / (2 * np.pi * drum), **turning}


def interference_lines(
    records: Sequence[Whitening], rows: Sequence[FloatArray], free: Sequence[NDArray[np.bool_]]
) -> list[NDArray[np.bool_]]:
    """Which lines of each record belong to a frequency that exceeds the noise of all tests together: mains, a gear.

    Parameters
    ----------
    records
        Of all tests.
    rows
        Whitened aperiodic part of each record.
    free
        Lines of each record that hold nothing but noise if there is no such frequency, (lines,).

    Returns
    -------
    list
        Per record, a subset of ``free``.
    """
    found = [np.zeros_like(part) for part in free]
    for _ in range(_INTERFERENCE_FREQUENCIES):
        peak = highest_frequency(records, rows, [here & ~there for here, there in zip(free, found, strict=True)])
        if peak is None or peak.p_value > _INTERFERENCE_P_VALUE:
            break
        for mine, here, near in zip(found, free, peak.near(records), strict=True):
            mine |= near & here
    return found


@dataclass(frozen=True)
class Peak:
    """The frequency [Hz] with the least probable power: summed whitened power, and its expectation for noise.

    The p-value is corrected for the number of frequencies (Bonferroni).
    """

    frequency: float
    power: float
    degrees_of_freedom: float
    p_value: float

    def near(self, records: Sequence[Whitening]) -> list[NDArray[np.bool_]]:
        """Which lines of each record its leakage reaches: none of a record that does not repeat."""
        return [
            (np.abs(np.arange(w.count // 2 + 1) - self.frequency * w.count * w.step) < _LEAKAGE) & (w.periods > 0)
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
    # less than a cycle in the longest record is no line: noise with a long memory drifts as much
    grid = np.arange(2, int(2 * longest * highest)) / (2 * longest)
    # the slowest lines of a coloured noise are hardly known
    known = [(records[i].frequencies, records[i].process.degrees_of_freedom) for i in places]
    freedom = np.array([np.interp(grid, *one) for one in known])
    power = np.array([_power_at(records[i], rows[i], kept[i], grid) for i in places]).sum(axis=0)
    weight = np.array([_weight_at(records[i], kept[i], grid) for i in places])
    total = np.maximum(weight.sum(axis=0), _LEAST)
    squares = np.maximum(np.sum(weight**2, axis=0), _LEAST**2)
    behind = total**2 / np.maximum(np.sum(weight**2 / freedom, axis=0), _LEAST**2 / freedom.max(axis=0))
    p = fdtrc(2 * total**2 / squares, behind, power / (2 * total))
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
