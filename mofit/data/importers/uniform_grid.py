r"""One signal on a uniform grid, without aliases.

Where the new rate :math:`f` is below that of the samples, the signal is interpolated on a fine uniform grid, low-passed
with a symmetric FIR filter (no phase shift), and every :math:`M`-th sample is kept. The Kaiser window of :math:`50 M`
steps has a pass band to :math:`0.4 f` (ripple :math:`10^{-4}`) and a stop band from :math:`0.5 f` (80 dB). A cubic
spline leaves of a sine with :math:`n` samples per period an error of about :math:`(n - 1)^{-4}`.

References
----------
Kaiser, "Nonrecursive digital filter design using the I0-sinh window function" (1974).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin, kaiser_beta, upfirdn

from mofit._typing import FloatArray


@dataclass(frozen=True)
class LowPassSettings:
    """Settings of the low-pass, each with its reason."""

    lower: float = 0.9
    """Share of the source rate below which a rate is lower: rounding and the scatter of uneven stamps do not filter."""
    pass_band: float = 0.4
    stop_band: float = 0.5
    """Edges, in new rates: nothing beyond the Nyquist frequency is left."""
    attenuation: float = 80.0
    """Of the stop band, in dB: four digits, more than most sensors resolve."""
    half_length: int = 25
    """Half of the filter in new samples, as Kaiser's formula asks for these edges and attenuation."""
    fine: float = 4.0
    """Rate of the fine grid, in source rates: what a spline makes of a tone beyond it is below -70 dB."""


LOW_PASS = LowPassSettings()


@dataclass(frozen=True, eq=False)
class Signal:
    """Samples of one channel over its own stamps in s, shape (n,) each."""

    time: FloatArray
    values: FloatArray


def is_lower(rate: float, step: float) -> bool:
    """Whether a rate in Hz is below that of samples with a ``step`` in s."""
    return rate * step < LOW_PASS.lower


def on_grid(signal: Signal, start: float, count: int, rate: float, linear: bool) -> FloatArray:
    """The signal at ``start + k / rate``, shape (count,).

    Parameters
    ----------
    signal
        Stamps increase; they need not be uniform.
    start, rate
        First time in s, within the signal; rate in Hz.
    linear
        Whether the signal runs straight between its samples; else as a cubic spline.
    """
    if len(signal.time) < 2:
        return np.full(count, signal.values[0])
    between = _interpolation(signal, linear)
    step = float(np.median(np.diff(signal.time)))
    if not is_lower(rate, step):
        return between(start + np.arange(count) / rate)
    multiple = int(np.ceil(LOW_PASS.fine / (step * rate)))
    half = LOW_PASS.half_length * multiple
    middle = (LOW_PASS.pass_band + LOW_PASS.stop_band) / 2 / multiple
    taps = firwin(2 * half + 1, middle, window=("kaiser", kaiser_beta(LOW_PASS.attenuation)), fs=1.0)
    fine = between(start + np.arange(-half, (count - 1) * multiple + half + 1) / (rate * multiple))
    first = 2 * LOW_PASS.half_length
    return np.asarray(upfirdn(taps, fine, down=multiple)[first : first + count], dtype=float)


def _interpolation(signal: Signal, linear: bool) -> Callable[[FloatArray], FloatArray]:
    """The signal between its samples; beyond its ends it is continued by point reflection."""
    time, values = signal.time, signal.values
    first, last = time[0], time[-1]
    # in usual steps from the begin, so that no power of a step vanishes
    step = float(np.median(np.diff(time)))
    spline = None if linear else CubicSpline((time - first) / step, values)

    def between(at: FloatArray) -> FloatArray:
        before, behind = at < first, at > last
        inside = np.where(before, 2 * first - at, np.where(behind, 2 * last - at, at)).clip(first, last)
        found = np.interp(inside, time, values) if spline is None else spline((inside - first) / step)
        return np.where(before, 2 * values[0] - found, np.where(behind, 2 * values[-1] - found, found))

    return between
