"""Signals that repeat: true period, waveform and noise, all from the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.sparse.linalg import splu

from mofit._typing import FloatArray


@dataclass(frozen=True)
class PeriodicitySettings:
    """When a signal counts as periodic."""

    sine_share: float = 0.95
    """Share of the variance that a sine and two harmonics must explain; noise and a trend take the rest."""
    difference: float = 0.05
    """Largest difference between repetitions, as a share of the variance: a signal-to-noise ratio of 20."""
    correlation_lengths: int = 15
    """That an overlap of less than half a period must span; shorter ones match by chance."""


PERIODICITY = PeriodicitySettings()


def find_period(time: FloatArray, values: FloatArray) -> float | None:
    r"""Period of a signal that repeats (multisine, burst, trajectory); None if it does not.

    The difference function :math:`D(L) = \langle (x_{i+L} - x_i)^2 \rangle / 2 \sigma^2` over the overlap is 1 where
    nothing repeats and :math:`\sigma_n^2 / \sigma^2` at a period. The period is the shortest lag with a deep minimum
    beyond the correlation length, refined between samples at its largest multiple that overlaps well.

    Parameters
    ----------
    time
        Uniform grid, shape (n,), in s.
    values
        Signal, shape (n,).

    Returns
    -------
    float or None
        Period in s. Half a period of overlap suffices, or a shorter one of 15 correlation lengths.
    """
    n, step = len(values), float((time[-1] - time[0]) / (len(time) - 1))
    if np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
        return None
    difference = _difference(values)
    if not (uncorrelated := np.flatnonzero(difference > 0.5)).size:
        return None
    memory = int(uncorrelated[0])
    lags = np.arange(1, n - 1)
    overlap = n - lags
    deep = (
        (difference[1:-1] < PERIODICITY.difference)
        & (difference[1:-1] <= difference[:-2])
        & (difference[1:-1] <= difference[2:])
        & (lags > memory)
        & ((overlap > 0.5 * lags) | (overlap > PERIODICITY.correlation_lengths * memory))
    )
    if not deep.any():
        return None
    lag = _minimum(difference, int(lags[deep][0]))
    # a longer multiple divides the error, as long as the overlap is long
    multiple = 2
    while (target := round(multiple * lag)) < n - max(0.25 * n, 2 * memory):
        near = np.arange(target - 2, target + 3)
        best = int(near[np.argmin(difference[near])])
        if difference[best] > 2 * PERIODICITY.difference:
            break
        lag = _minimum(difference, best) / multiple
        multiple += 1
    return lag * step


def sine_period(time: FloatArray, values: FloatArray) -> float | None:
    r"""Period of a sine by non-linear least squares; None if it is none.

    Fits :math:`a_0 + a_1 t + \sum_{h=1}^{3} (b_h \cos h \omega t + c_h \sin h \omega t)`, with :math:`\omega` from the
    peak of the spectrum on; the amplitudes are eliminated (variable projection). A Hann window weighs the samples, so
    that ramps at both ends of a record do not count.
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
    frequency, width = peak / (padded * (duration / (len(t) - 1))), 0.6 / duration
    for harmonics, narrowing in ((1, 0.2), (3, 0.02)):
        data = (t, x, window, harmonics)
        grid = np.linspace(max(frequency - width, 0.4 / duration), frequency + width, 13)
        frequency, near = float(grid[np.argmin([_misfit(f, *data) for f in grid])]), grid[1] - grid[0]
        bounds, options = (frequency - near, frequency + near), {"xatol": 1e-9 * frequency}
        frequency = float(minimize_scalar(_misfit, bounds=bounds, args=data, method="bounded", options=options).x)
        width *= narrowing
    trendless = _misfit(0.0, t, x, window, 0)
    if (
        trendless < 1e-20 * np.sum(x**2)
        or _misfit(frequency, t, x, window, 3) > (1 - PERIODICITY.sine_share) * trendless
    ):
        return None
    return 1.0 / frequency


def periodic_fit(
    time: FloatArray, values: FloatArray, period: float, at: FloatArray | None = None
) -> tuple[FloatArray, int]:
    """Least-squares periodic waveform, a cubic B-spline over the phase with about one knot per sample.

    Each sample keeps its own phase, so the number of samples per period need not be whole. Interpolation onto a
    common phase grid would smooth the noise.

    Parameters
    ----------
    time, values
        Samples that the waveform is fitted to, shape (n,).
    period
        In s.
    at
        Times at which the waveform is returned; by default ``time``.

    Returns
    -------
    waveform
        Shape of ``at``.
    parameters
        Degrees of freedom of the fit.
    """
    step = (time[-1] - time[0]) / (len(time) - 1)
    knots = max(4, min(round(period / step), len(time) // 2))
    design = _design(time - time[0], period, knots)
    normal = design.T @ design
    # samples that fall between the same knots in every period leave one combination free
    ridge = 1e-9 * normal.diagonal().max() * sparse.eye_array(knots, format="csc")
    weights = splu(sparse.csc_matrix(normal + ridge)).solve(design.T @ values)
    wanted = design if at is None else _design(at - time[0], period, knots)
    return np.asarray(wanted @ weights), knots


def repeat_noise(time: FloatArray, values: FloatArray, period: float) -> float:
    r"""Standard deviation of what differs between periods, for at least two of them.

    :math:`\hat\sigma^2 = \sum (x - w)^2 / (n - k)` with the periodic waveform w of k degrees of freedom
    (`periodic_fit`), for white and coloured noise. Slow drift counts as noise; a disturbance that repeats with the
    period does not.
    """
    waveform, parameters = periodic_fit(time, values, period)
    return float(np.sqrt(np.sum((values - waveform) ** 2) / (len(values) - parameters)))


def overlap_noise(time: FloatArray, values: FloatArray, period: float) -> float:
    """Standard deviation of what differs between the start of a record and its repetition one period later.

    For records of one to two periods. The first half of the overlap is left out, as it may be transient. Interpolation
    of the later samples smooths their noise a little, unless the period is whole samples.
    """
    first = time <= time[-1] - period
    first &= time >= time[0] + 0.5 * (time[-1] - period - time[0])
    later = CubicSpline(time, values)(time[first] + period)
    return float(np.sqrt(np.mean((later - values[first]) ** 2) / 2))


def _difference(values: FloatArray) -> FloatArray:
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


def _minimum(difference: FloatArray, lag: int) -> float:
    """Place of the minimum near an integer lag, between the lags."""
    reach = min(4, lag - 1, len(difference) - 1 - lag)
    if reach < 1:
        return float(lag)
    near = np.arange(lag - reach, lag + reach + 1)
    spline = CubicSpline(near, difference[near])
    found = minimize_scalar(spline, bounds=(lag - 1, lag + 1), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


def _misfit(frequency: float, t: FloatArray, x: FloatArray, window: FloatArray, harmonics: int) -> float:
    """Residual sum of squares of the best series at this frequency; ``x`` carries the window already."""
    phase = 2 * np.pi * frequency * np.outer(t, np.arange(1, harmonics + 1))
    design = np.column_stack([np.ones_like(t), t, np.cos(phase), np.sin(phase)]) * window[:, None]
    # normal equations: few well separated columns, and far faster than an SVD
    normal = design.T @ design
    scale = np.sqrt(np.diag(normal))
    normal = normal / np.outer(scale, scale) + 1e-12 * np.eye(len(scale))
    projection = design.T @ x / scale
    return float(x @ x - projection @ np.linalg.solve(normal, projection))


def _design(t: FloatArray, period: float, knots: int) -> sparse.csc_matrix:
    """Values of the periodic cubic B-splines, shape (n, knots)."""
    place = (t / period) % 1.0 * knots
    left = np.floor(place)
    u = place - left
    values = np.stack(
        [(1 - u) ** 3 / 6, (3 * u**3 - 6 * u**2 + 4) / 6, (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6, u**3 / 6], axis=1
    )
    columns = (left[:, None].astype(int) + np.arange(-1, 3)) % knots
    rows = np.repeat(np.arange(len(t)), 4)
    return sparse.csc_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(t), knots))
