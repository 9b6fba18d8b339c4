"""Convergence diagnostics of chains: autocorrelation time, R-hat, effective sample size, walkers that do not mix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from mofit._typing import FloatArray
from mofit.sampling.settings import SampleSettings


def autocorrelation_time(chain: FloatArray) -> FloatArray:
    r"""Integrated autocorrelation time, in steps, per parameter.

    .. math:: \tau = 1 + 2 \sum_{k=1}^{M} \rho(k), \quad M = \min\{m : m \ge 5 \tau(m)\}

    with rho of the deviations from the common mean, averaged over all walkers (Sokal's window), never below 1. Walkers
    that keep to different places thus lengthen it.

    Parameters
    ----------
    chain
        Shape (step, walker, d), walkers of all ensembles side by side.

    Returns
    -------
    Shape (d,); ``inf`` where it cannot be estimated (a parameter never moved, or fewer than 8 steps).
    """
    steps, walkers, dimension = chain.shape
    if steps < 8 or walkers == 0:
        return np.full(dimension, np.inf)
    centred = np.ascontiguousarray((chain - chain.mean(axis=(0, 1))).transpose(2, 1, 0))
    length = next_fast_len(2 * steps, real=True)
    power = np.abs(rfft(centred, n=length)) ** 2
    covariance = irfft(power.sum(axis=1), n=length)[:, :steps]
    with np.errstate(invalid="ignore", divide="ignore"):
        grown = 2 * np.cumsum(covariance / covariance[:, :1], axis=1) - 1
    enough = np.arange(steps) >= 5 * grown
    window = np.where(enough.any(axis=1), enough.argmax(axis=1), steps - 1)
    tau = grown[np.arange(dimension), window]
    return np.where(np.isfinite(tau) & (np.ptp(chain, axis=(0, 1)) > 0), np.maximum(tau, 1.0), np.inf)


def r_hat(points: FloatArray) -> FloatArray:
    """Rank-normalised split R-hat per parameter, shape (d,), as ArviZ computes it; nan with fewer than 4 draws.

    Parameters
    ----------
    points
        Draws, shape (chain, draw, d).

    References
    ----------
    Vehtari, Gelman, Simpson, Carpenter, Bürkner: Rank-normalization, folding, and localization: an improved R-hat
    (2021).
    """
    from arviz_stats.base import array_stats  # late: its import takes half a second

    if points.shape[1] < 4:
        return np.full(points.shape[2], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # a parameter that never moved has none
        return np.asarray(array_stats.rhat(points, chain_axis=0, draw_axis=1))


def effective_size(points: FloatArray) -> FloatArray:
    """Bulk effective sample size per parameter, shape (d,), as ArviZ computes it; 0 with fewer than 4 draws.

    Parameters
    ----------
    points
        Draws, shape (chain, draw, d).

    References
    ----------
    As for `r_hat`.
    """
    from arviz_stats.base import array_stats

    if points.shape[1] < 4:
        return np.zeros(points.shape[2])
    return np.asarray(array_stats.ess(points, chain_axis=0, draw_axis=1), dtype=float)


def outliers(positions: FloatArray, log_prob: FloatArray, threshold: float) -> NDArray[np.bool_]:
    """Walkers far from the others at one moment, shape (n,).

    In a coordinate, or in log posterior, further from the median than `threshold` robust standard deviations (1.48
    times the median absolute deviation).

    Parameters
    ----------
    positions, log_prob
        Shapes (n, d) and (n,).
    """
    values = np.column_stack([positions, log_prob])
    gap = np.abs(values - np.median(values, axis=0))
    return np.any(gap > threshold * 1.4826 * np.median(gap, axis=0), axis=1)


def stuck_walkers(
    chain: FloatArray, log_prob: FloatArray, tau: float, settings: SampleSettings
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    r"""Walkers that did not move, and walkers that left for another mode, over the second half of a chain.

    A walker has *left* if its mean, in a coordinate or in log posterior, differs from the median of all walkers' means
    by more than

    .. math:: \max(6 s \sqrt{\tau / n}, \tfrac32 s, 3 s_w),

    with s the typical and :math:`s_w` its own standard deviation over the n steps: six standard errors, a distance that
    matters, and a place that it does not come back from. The three factors are `SampleSettings.left`. A walker that
    commutes between modes, or lingers in a tail, has not left.

    Parameters
    ----------
    chain, log_prob
        Shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    tau
        Autocorrelation time in steps.

    Returns
    -------
    ``stuck`` and ``left``, shape (ensemble, walker).
    """
    half = chain.shape[1] // 2
    values = np.concatenate([chain, log_prob[..., None]], axis=3)[:, half:]
    count = values.shape[1]
    if count < 10:
        nobody = np.zeros((chain.shape[0], chain.shape[2]), dtype=bool)
        return nobody, nobody
    sd, mean = values.std(axis=1, ddof=1), values.mean(axis=1)
    stuck = np.all(np.ptp(values, axis=1) == 0, axis=2)
    errors, typical, own = settings.left
    common = max(errors * np.sqrt(min(tau, count) / count), typical) * np.median(sd, axis=(0, 1))
    limit = np.maximum(common, own * sd)
    left = np.any(np.abs(mean - np.median(mean, axis=(0, 1))) > limit, axis=2)
    return stuck, left & ~stuck
