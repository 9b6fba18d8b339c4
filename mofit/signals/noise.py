"""Noise of a signal: what does not repeat from period to period, or what no smooth curve follows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mofit.signals.smoothing import smooth
from mofit.signals.waveform import periodic_fit

Array = NDArray[np.float64]

#: below this share of the smoothing residual the top of the spectrum is believed instead; a short
#: record scatters by a fifth or so
_FAR_LOWER = 0.5
#: levels from which on a signal counts as quantised
_FEWEST_LEVELS = 8


def repeat_noise(time: Array, values: Array, period: float) -> float:
    r"""Standard deviation of what differs between periods, for at least two of them.

    :math:`\hat\sigma^2 = \sum (x - w)^2 / (n - k)` with the periodic waveform w of k degrees of
    freedom (`periodic_fit`). Holds for white and coloured noise alike; slow drift counts as noise,
    a disturbance that repeats with the period does not.
    """
    waveform, parameters = periodic_fit(time, values, period)
    return float(np.sqrt(np.sum((values - waveform) ** 2) / (len(values) - parameters)))


def overlap_noise(time: Array, values: Array, period: float) -> float:
    """Standard deviation of what differs between the start of a record and its repetition one period later.

    For records of one to two periods; the first half of the overlap is left out, as it may be
    transient. The later samples are interpolated, which smooths their noise a little unless the
    period is whole samples.
    """
    first = time <= time[-1] - period
    first &= time >= time[0] + 0.5 * (time[-1] - period - time[0])
    later = CubicSpline(time, values)(time[first] + period)
    return float(np.sqrt(np.mean((later - values[first]) ** 2) / 2))


def residual_noise(values: Array) -> tuple[float, str]:
    """Standard deviation of white noise on a signal that does not repeat, and how it was found.

    ``"smoothing residual"``: residuals of a smoothing by generalised cross-validation (`smooth`),
    corrected for its degrees of freedom. ``"top of spectrum"``: a signal too broad to be smooth
    shows by a far lower level above 0.8 of the Nyquist frequency, which is taken then. Neither is
    below quantisation. Both take noise as white: slow noise passes for signal, and behind an
    anti-alias filter the top of the spectrum is only a lower bound.
    """
    smooth_level, top_level = smooth(values).noise_sd, _top_of_spectrum(values)
    level, method = smooth_level, "smoothing residual"
    if top_level < _FAR_LOWER * smooth_level:
        level, method = top_level, "top of spectrum"
    return float(max(level, quantum(values) / np.sqrt(12))), method


def _top_of_spectrum(values: Array) -> float:
    """Level of white noise that explains the median of the spectrum above 0.8 of the Nyquist frequency."""
    n = len(values)
    window = np.hanning(n + 2)[1:-1]
    straight = np.linspace(values[0], values[-1], n)
    power = np.abs(np.fft.rfft((values - straight) * window)) ** 2 / np.sum(window**2)
    # power of white noise is exponentially distributed: median = mean ln 2
    return float(np.sqrt(np.median(power[int(0.8 * len(power)) :]) / np.log(2)))


def quantum(values: Array) -> float:
    """Resolution step of a quantised signal; 0 if the values do not lie on a grid."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.ptp(values)] if len(levels) > 1 else gaps
    # few levels are a signal that steps; with few repeated values a grid cannot be told from chance
    if not gaps.size or not _FEWEST_LEVELS <= len(levels) <= 0.5 * len(values):
        return 0.0
    smallest = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / smallest
    return smallest if np.all(np.abs(multiples - np.round(multiples)) < 0.1 * np.maximum(multiples, 1)) else 0.0
