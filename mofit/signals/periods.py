"""The true period of a signal, from the data: labels of rigs are off by some percent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

#: share of the variance that a sine and its harmonics must explain
SINE_EXPLAINS = 0.95
#: a repetition differs from the original by less than this share of the variance …
REPEATS_WITHIN = 0.05
#: … over at least this many correlation lengths
CORRELATION_LENGTHS = 15


def find_period(time: Array, values: Array) -> float | None:
    r"""Period of a signal that repeats (multisine, burst, trajectory); None if it does not.

    The difference function :math:`D(L) = \langle (x_{i+L} - x_i)^2 \rangle / 2 \sigma^2` over the
    overlap is 1 where nothing repeats and :math:`\sigma_n^2 / \sigma^2` at a period. The shortest
    lag with a deep minimum, after the signal has lost its memory, is the period; it is refined
    between samples at its largest multiple that overlaps well.

    Parameters
    ----------
    time
        Uniform grid, shape (n,), in s.
    values
        Signal, shape (n,).

    Returns
    -------
    float or None
        Period in s. Half a period of overlap suffices, or a shorter one that spans
        `CORRELATION_LENGTHS`.
    """
    n, step = len(values), float((time[-1] - time[0]) / (len(time) - 1))
    if np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
        return None
    difference = _difference(values)
    if not (forgotten := np.flatnonzero(difference > 0.5)).size:
        return None
    memory = int(forgotten[0])
    lags = np.arange(1, n - 1)
    overlap = n - lags
    deep = (
        (difference[1:-1] < REPEATS_WITHIN)
        & (difference[1:-1] <= difference[:-2])
        & (difference[1:-1] <= difference[2:])
        & (lags > memory)
        & ((overlap > 0.5 * lags) | (overlap > CORRELATION_LENGTHS * memory))
    )
    if not deep.any():
        return None
    first = int(lags[deep][0])
    lag = _minimum(difference, first)
    # a longer multiple divides the error; the overlap must stay long enough to be trusted
    multiple = 2
    while (target := round(multiple * lag)) < n - max(0.25 * n, 2 * memory):
        near = np.arange(target - 2, target + 3)
        best = int(near[np.argmin(difference[near])])
        if difference[best] > 2 * REPEATS_WITHIN:
            break
        lag = _minimum(difference, best) / multiple
        multiple += 1
    return lag * step


def sine_period(time: Array, values: Array) -> float | None:
    r"""Period of a sine by non-linear least squares; None if it is none.

    Fits :math:`a_0 + a_1 t + \sum_{h=1}^{3} (b_h \cos h \omega t + c_h \sin h \omega t)`, with :math:`\omega` from the
    peak of the spectrum on; the amplitudes are eliminated (variable projection). Samples weigh as a
    Hann window, so that ramps at both ends of a record do not count.
    """
    if np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
        return None
    t = time - time[0]
    t, duration = t - t.mean(), t[-1]
    window = np.hanning(len(t) + 2)[1:-1]
    x = window * (values - np.average(values, weights=window))
    padded = 8 * len(x)
    spectrum = np.abs(np.fft.rfft(x, padded))
    peak = max(int(np.argmax(spectrum[1:])) + 1, 4)
    start = peak / (padded * (duration / (len(t) - 1)))
    guess, width = start, 0.6 / duration
    for harmonics, narrowing in ((1, 0.2), (3, 0.02)):
        bounds = (max(guess - width, 0.4 / duration), guess + width)
        grid = np.linspace(*bounds, 13)
        guess = float(grid[np.argmin([_misfit(f, t, x, window, harmonics) for f in grid])])
        near = grid[1] - grid[0]
        guess = float(
            minimize_scalar(
                _misfit,
                bounds=(guess - near, guess + near),
                args=(t, x, window, harmonics),
                method="bounded",
                options={"xatol": 1e-9 * guess},
            ).x
        )
        width *= narrowing
    trendless = _misfit(0.0, t, x, window, 0)
    if trendless < 1e-20 * np.sum(x**2) or _misfit(guess, t, x, window, 3) > (1 - SINE_EXPLAINS) * trendless:
        return None
    return 1.0 / guess


def _difference(values: Array) -> Array:
    """D(L) for L = 0 … n-1, from one FFT."""
    n = len(values)
    x = values - values.mean()
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    products = np.fft.irfft(spectrum * np.conj(spectrum), size)[:n]
    squares = np.cumsum(x**2)
    head = squares[::-1]  # of x[: n - L]
    tail = squares[-1] - np.concatenate([[0.0], squares[:-1]])  # of x[L:]
    difference = np.maximum(head + tail - 2 * products, 0.0) / (2 * x.var())
    return difference / np.arange(n, 0, -1)


def _minimum(difference: Array, lag: int) -> float:
    """Place of the minimum near an integer lag, between the lags."""
    reach = min(4, lag - 1, len(difference) - 1 - lag)
    if reach < 1:
        return float(lag)
    near = np.arange(lag - reach, lag + reach + 1)
    spline = CubicSpline(near, difference[near])
    found = minimize_scalar(spline, bounds=(lag - 1, lag + 1), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


def _misfit(frequency: float, t: Array, x: Array, window: Array, harmonics: int) -> float:
    """Residual sum of squares of the best series at this frequency; ``x`` carries the window already."""
    phase = 2 * np.pi * frequency * np.outer(t, np.arange(1, harmonics + 1))
    design = np.column_stack([np.ones_like(t), t, np.cos(phase), np.sin(phase)]) * window[:, None]
    # normal equations: few well separated columns, and far faster than an SVD
    normal = design.T @ design
    scale = np.sqrt(np.diag(normal))
    normal = normal / np.outer(scale, scale) + 1e-12 * np.eye(len(scale))
    projection = design.T @ x / scale
    return float(x @ x - projection @ np.linalg.solve(normal, projection))
