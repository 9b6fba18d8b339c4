"""The waveform that a periodic signal repeats."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]


def periodic_fit(time: Array, values: Array, period: float, at: Array | None = None) -> tuple[Array, int]:
    """Least-squares periodic waveform, a cubic B-spline over the phase with about one knot per sample.

    The samples are not interpolated onto a common phase grid, which would smooth their noise: each
    keeps its own phase, so the number of samples per period need not be whole.

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
        Degrees of freedom that the fit has used.
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


def _design(t: Array, period: float, knots: int) -> sparse.csc_matrix:
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
