"""Time derivative of a measured signal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from mofit.signals.noise import quantum, residual_noise
from mofit.signals.smoothing import smooth

Array = NDArray[np.float64]


def smooth_derivative(time: Array, values: Array, noise_sd: float | None = None) -> tuple[Array, Array]:
    r"""Smoothed signal and its time derivative; never raw differences.

    A smoothing spline: penalised smoothing (`mofit.signals.smooth`) whose stiffness follows from the
    noise level, then the analytic derivative of the quintic spline through the smooth values.

    Parameters
    ----------
    time
        Uniform grid, shape (n,), in s.
    values
        Signal, shape (n,).
    noise_sd
        Standard deviation of its noise; by default as `mofit.signals.residual_noise` finds it. A
        quantised signal has at least the noise of its resolution, :math:`q / \sqrt{12}`.

    Returns
    -------
    smoothed, derivative
        Shape (n,) each; unit of the signal, and per s.

    Notes
    -----
    Bias: a component of frequency f is scaled by :math:`1 / (1 + \lambda (2 \sin \pi f \Delta t)^6)`, so
    frequencies near and above the cut-off where signal meets noise are damped. The variance is
    largest within a few cut-off periods of both ends. Noise is taken as white; slower noise passes.
    """
    step = float((time[-1] - time[0]) / (len(time) - 1))
    level = residual_noise(values)[0] if noise_sd is None else max(noise_sd, quantum(values) / np.sqrt(12))
    smoothed = smooth(values, level).values
    grid = np.arange(len(values), dtype=float)
    return smoothed, make_interp_spline(grid, smoothed, k=5).derivative()(grid) / step
