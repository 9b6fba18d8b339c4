"""Penalised smoothing on a uniform grid (Whittaker 1923), the discrete form of the quintic smoothing spline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.optimize import minimize_scalar
from scipy.special import binom

Array = NDArray[np.float64]

#: order of the difference that is penalised
ORDER = 3
#: search range of log10 of the stiffness: from none to a cut-off period of 290 samples, beyond which
#: rounding spoils the solution
_STIFFNESS = (-6.0, 10.0)
#: weight of the degrees of freedom in cross-validation; above 1 it stops chance fits (Kim & Gu 2004)
_CAUTION = 1.4


@dataclass(frozen=True)
class Smoothed:
    """Smooth values, the residual sum of squares and the degrees of freedom that were used."""

    values: Array
    rss: float
    freedom: float

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the residuals, corrected for the degrees of freedom."""
        return float(np.sqrt(self.rss / max(len(self.values) - self.freedom, 1.0)))


def smooth(values: Array, noise_sd: float | None = None) -> Smoothed:
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
    # the trend that no stiffness touches is taken off for the sake of rounding
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
            return float(
                np.log(trial.rss + np.finfo(float).tiny) - 2 * np.log(max(n - _CAUTION * trial.freedom, 1e-6 * n))
            )
        return trial.rss + 2 * noise_sd**2 * trial.freedom

    grid = np.arange(_STIFFNESS[0], _STIFFNESS[1] + 0.1, 1.0)
    best = float(grid[np.argmin([score(value) for value in grid])])
    bounds = (best - 1, min(best + 1, _STIFFNESS[1]))
    best = float(minimize_scalar(score, bounds=bounds, method="bounded", options={"xatol": 0.02}).x)
    found = at(best)
    return Smoothed(found.values + trend, found.rss, found.freedom)


def _system(n: int, stiffness: float) -> Array:
    """Upper bands of 1 + stiffness DᵀD with D the difference of order `ORDER`, shape (ORDER + 1, n)."""
    weights = np.array([(-1) ** k * binom(ORDER, k) for k in range(ORDER + 1)])
    bands = np.zeros((ORDER + 1, n))
    for i in range(ORDER + 1):
        for j in range(i, ORDER + 1):
            # every row r of D adds w_i w_j at (r + i, r + j)
            bands[ORDER - (j - i), j : n - ORDER + j] += stiffness * weights[i] * weights[j]
    bands[ORDER] += 1.0
    return bands
