"""Filters of one signal on a uniform grid, between whose samples it is a cubic spline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import cont2discrete, lfilter, lfilter_zi

Array = NDArray[np.float64]

#: filters take the signal as linear between points no further apart than this, s
FINE = 6e-4


def rational(signal: Array, numerator: list[float], denominator: list[float], step: float) -> Array:
    """Output of a transfer function, settled at the first value of the signal (n,)."""
    parts = int(np.ceil(step / FINE))
    top, bottom, _ = cont2discrete((numerator, denominator), step / parts, method="foh")
    top, bottom = np.ravel(top), np.ravel(bottom)
    start = lfilter_zi(top, bottom) * signal[0]
    count = len(signal)
    fine = CubicSpline(np.arange(count), signal)(np.arange((count - 1) * parts + 1) / parts)
    return np.asarray(lfilter(top, bottom, fine, zi=start)[0][::parts])


def lag(signal: Array, time_constant: float, step: float) -> Array:
    """Behind a first-order lag."""
    return rational(signal, [1.0], [time_constant, 1.0], step)


def later(signal: Array, delay: float, step: float) -> Array:
    """The signal a time ago; before its beginning it stood still."""
    time = step * np.arange(len(signal))
    return np.asarray(CubicSpline(time, signal)(np.clip(time - delay, 0, time[-1])))


def play(signal: Array, half_width: float) -> Array:
    """What is dragged along with a play of plus and minus ``half_width``, centred at the start."""
    result = np.empty_like(signal)
    here = 0.0
    for n, (low, high) in enumerate(zip((signal - half_width).tolist(), (signal + half_width).tolist(), strict=True)):
        here = min(max(here, low), high)
        result[n] = here
    return result


def slope_before(signal: Array, step: float) -> Array:
    """Derivative (n,) from the past alone: of a kink, the slope before it."""
    result = np.gradient(signal, step)
    result[2:] = (3 * signal[2:] - 4 * signal[1:-1] + signal[:-2]) / (2 * step)
    return result
