"""Signals that do not repeat: penalised smoothing (Whittaker 1923), their noise, their derivative.

The smoothing is the discrete form of the quintic smoothing spline. Noise is taken as white.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.linalg import solveh_banded
from scipy.optimize import minimize_scalar
from scipy.special import binom

from mofit._typing import FloatArray

#: order of the difference that is penalised
ORDER = 3


@dataclass(frozen=True)
class SmoothingSettings:
    """How far a signal is smoothed, and which estimate of its noise is taken."""

    stiffness: tuple[float, float] = (-6.0, 10.0)
    """Search range of its log10: from none to a cut-off period of 290 samples, where rounding errors begin."""
    freedom_weight: float = 1.4
    """Weight of the degrees of freedom in cross-validation; above 1 it avoids fits to noise (Kim & Gu 2004)."""
    top_share: float = 0.5
    """The top of the spectrum is taken below this share of the smoothing residual; short records scatter by a fifth."""
    fewest_levels: int = 8
    """Of a quantised signal; one with fewer is a step signal."""


SMOOTHING = SmoothingSettings()


@dataclass(frozen=True)
class Smoothed:
    """Smooth values, the residual sum of squares and the degrees of freedom of the smooth curve."""

    values: FloatArray
    rss: float
    degrees_of_freedom: float

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the residuals, corrected for the degrees of freedom."""
        return float(np.sqrt(self.rss / max(len(self.values) - self.degrees_of_freedom, 1.0)))


def smooth(values: FloatArray, noise_sd: float | None = None) -> Smoothed:
    r"""Smooth values :math:`z` that minimise :math:`\sum (x - z)^2 + \lambda \sum (\Delta^3 z)^2`.

    Parameters
    ----------
    values
        Signal on a uniform grid, shape (n,), n ≥ 8.
    noise_sd
        Standard deviation of its noise, taken as white. With it :math:`\lambda` minimises the
        unbiased estimate of the risk :math:`R + 2 \sigma^2 f` (R: residual sum of squares, f: degrees of freedom);
        without, generalised cross-validation :math:`R / (n - 1.4 f)^2`.
    """
    n = len(values)
    # the penalty does not touch this trend; without it, rounding errors are smaller
    t = np.linspace(-1, 1, n)
    trend = np.polyval(np.polyfit(t, values, ORDER - 1), t)
    x = values - trend
    # free ends shift the modes of the penalty by half its order less one; the first ORDER have none
    modes = np.arange(ORDER, n) - (ORDER - 1) / 2
    eigenvalues = (2 * np.sin(np.pi * modes / (2 * n))) ** (2 * ORDER)

    def at(log_stiffness: float) -> Smoothed:
        stiffness = 10.0**log_stiffness
        z = solveh_banded(_system(n, stiffness), x, lower=False)
        freedom = ORDER + float(np.sum(1 / (1 + stiffness * eigenvalues)))
        return Smoothed(z, float(np.sum((x - z) ** 2)), freedom)

    def score(log_stiffness: float) -> float:
        trial = at(log_stiffness)
        if noise_sd is None:
            left = max(n - SMOOTHING.freedom_weight * trial.degrees_of_freedom, 1e-6 * n)
            return float(np.log(trial.rss + np.finfo(float).tiny) - 2 * np.log(left))
        return trial.rss + 2 * noise_sd**2 * trial.degrees_of_freedom

    grid = np.arange(SMOOTHING.stiffness[0], SMOOTHING.stiffness[1] + 0.1, 1.0)
    best = float(grid[np.argmin([score(value) for value in grid])])
    bounds = (best - 1, min(best + 1, SMOOTHING.stiffness[1]))
    best = float(minimize_scalar(score, bounds=bounds, method="bounded", options={"xatol": 0.02}).x)
    found = at(best)
    return Smoothed(found.values + trend, found.rss, found.degrees_of_freedom)


def smooth_derivative(
    time: FloatArray, values: FloatArray, noise_sd: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Smoothed signal and its time derivative; see `smooth_derivatives`."""
    smoothed, slope = smooth_derivatives(time, values, 1, noise_sd)
    return smoothed, slope


def smooth_derivatives(
    time: FloatArray, values: FloatArray, order: int, noise_sd: float | None = None
) -> list[FloatArray]:
    r"""Smoothed signal and its time derivatives up to an order; never raw differences.

    Penalised smoothing (`smooth`) with a stiffness that follows from the noise level, then the analytic derivatives
    of the quintic spline through the smooth values.

    Parameters
    ----------
    time
        Uniform grid, shape (n,), in s.
    values
        Signal, shape (n,).
    order
        Of the highest derivative, at most 4.
    noise_sd
        Standard deviation of its noise; by default that of `residual_noise`. A quantised signal has at least the
        noise of its resolution, :math:`q / \sqrt{12}`.

    Returns
    -------
    list
        Shape (n,) each; unit of the signal, and per s, per s² …

    Notes
    -----
    Bias: a component of frequency f is scaled by :math:`1 / (1 + \lambda (2 \sin \pi f \Delta t)^6)`: frequencies
    near and above the cut-off, where signal meets noise, are damped. The variance is largest within a few cut-off
    periods of both ends. Noise is taken as white; slower noise passes.
    """
    step = float((time[-1] - time[0]) / (len(time) - 1))
    level = residual_noise(values)[0] if noise_sd is None else max(noise_sd, quantisation_step(values) / np.sqrt(12))
    smoothed = smooth(values, level).values
    grid = np.arange(len(values), dtype=float)
    spline = make_interp_spline(grid, smoothed, k=5)
    return [smoothed, *(spline.derivative(k)(grid) / step**k for k in range(1, order + 1))]


def residual_noise(values: FloatArray) -> tuple[float, str]:
    """Standard deviation of white noise on a signal that does not repeat, and the method that found it.

    ``"smoothing residual"``: residuals of `smooth` by generalised cross-validation, corrected for its degrees of
    freedom. ``"top of spectrum"``: the level above 0.8 of the Nyquist frequency, taken where it is far lower, because
    the signal is then too broad to be smooth. Neither is below the quantisation noise. Slow noise passes for signal,
    and behind an anti-alias filter the top of the spectrum is only a lower bound.
    """
    smooth_level, top_level = smooth(values).noise_sd, _top_of_spectrum(values)
    level, method = smooth_level, "smoothing residual"
    if top_level < SMOOTHING.top_share * smooth_level:
        level, method = top_level, "top of spectrum"
    return float(max(level, quantisation_step(values) / np.sqrt(12))), method


def quantisation_step(values: FloatArray) -> float:
    """Resolution step of a quantised signal; 0 if the values do not lie on a grid."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.ptp(values)] if len(levels) > 1 else gaps
    # few levels are a signal that steps; without repeated values a grid may be chance
    if not gaps.size or not SMOOTHING.fewest_levels <= len(levels) <= 0.5 * len(values):
        return 0.0
    smallest = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / smallest
    return smallest if np.all(np.abs(multiples - np.round(multiples)) < 0.1 * np.maximum(multiples, 1)) else 0.0


def _system(n: int, stiffness: float) -> FloatArray:
    """Upper bands of 1 + stiffness DᵀD with D the difference of order `ORDER`, shape (ORDER + 1, n)."""
    weights = np.array([(-1) ** k * binom(ORDER, k) for k in range(ORDER + 1)])
    bands = np.zeros((ORDER + 1, n))
    for i in range(ORDER + 1):
        for j in range(i, ORDER + 1):
            # every row r of D adds w_i w_j at (r + i, r + j)
            bands[ORDER - (j - i), j : n - ORDER + j] += stiffness * weights[i] * weights[j]
    bands[ORDER] += 1.0
    return bands


def _top_of_spectrum(values: FloatArray) -> float:
    """Level of white noise that explains the median of the spectrum above 0.8 of the Nyquist frequency."""
    n = len(values)
    window = np.hanning(n + 2)[1:-1]
    straight = np.linspace(values[0], values[-1], n)
    power = np.abs(np.fft.rfft((values - straight) * window)) ** 2 / np.sum(window**2)
    # power of white noise is exponentially distributed: median = mean ln 2
    return float(np.sqrt(np.median(power[int(0.8 * len(power)) :]) / np.log(2)))
