"""Convergence numbers of chains: autocorrelation time, rank-normalised R-hat, effective sample size.

The latter two are ArviZ's numbers (tested against arviz-stats), computed here because importing arviz-stats takes
longer than sampling a mode.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import ndtri

from mofit.parameters import Array


def autocorrelation_time(chain: Array) -> Array:
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


def r_hat(points: Array) -> Array:
    r"""Rank-normalised split R-hat per parameter.

    .. math:: \hat R = \sqrt{\frac{n - 1}{n} + \frac{B}{n W}}

    with B/n the variance of the means and W the mean of the variances of the half chains, n draws each; the larger of
    the values for the rank-normalised draws and for their distances from the median.

    Parameters
    ----------
    points
        Draws, shape (chain, draw, d).

    Returns
    -------
    Shape (d,); nan with fewer than 4 draws per chain.

    References
    ----------
    Vehtari, Gelman, Simpson, Carpenter, Bürkner: Rank-normalization, folding, and localization: an improved R-hat
    (2021).
    """
    if points.shape[1] < 4:
        return np.full(points.shape[2], np.nan)
    halves = [_halves(points[:, :, k]) for k in range(points.shape[2])]
    return np.array([max(_plain_r_hat(_normal_scores(x)), _plain_r_hat(_normal_scores(_folded(x)))) for x in halves])


def effective_size(points: Array) -> Array:
    r"""Bulk effective sample size per parameter.

    .. math:: \mathrm{ESS} = \frac{m n}{-1 + 2 \sum_k \hat P_k}, \quad \hat P_k = \hat\rho_{2k} + \hat\rho_{2k+1}

    of the rank-normalised half chains (m of them, n draws each), with the autocorrelations over all chains cut at the
    first negative pair and made monotone (Geyer 1992).

    Parameters
    ----------
    points
        Draws, shape (chain, draw, d).

    Returns
    -------
    Shape (d,); 0 with fewer than 4 draws per chain.

    References
    ----------
    As for `r_hat`.
    """
    if points.shape[1] < 4:
        return np.zeros(points.shape[2])
    return np.array([_geyer(_normal_scores(_halves(points[:, :, k]))) for k in range(points.shape[2])])


def _halves(draws: Array) -> Array:
    half = draws.shape[1] // 2
    return np.concatenate([draws[:, :half], draws[:, -half:]])


def _folded(draws: Array) -> Array:
    return np.abs(draws - np.median(draws))


def _normal_scores(draws: Array) -> Array:
    """Normal quantiles of the ranks over all chains (Blom's fractional offset 3/8)."""
    _, which, times = np.unique(draws, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(times) - (times - 1) / 2)[which].reshape(draws.shape)  # ties share the mean of their ranks
    return np.asarray(ndtri((ranks - 3 / 8) / (draws.size + 1 / 4)), dtype=float)


def _plain_r_hat(draws: Array) -> float:
    within = draws.var(axis=1, ddof=1).mean()
    count = draws.shape[1]
    if within == 0:
        return np.nan
    return float(np.sqrt((count - 1) / count + draws.mean(axis=1).var(ddof=1) / within))


def _geyer(draws: Array) -> float:
    count = draws.shape[1]
    if np.ptp(draws) == 0:
        return float(draws.size)
    spectrum = np.fft.rfft(draws - draws.mean(axis=1, keepdims=True), n=2 * count, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, :count].mean(axis=0) / count
    within = covariance[0] * count / (count - 1)
    total = covariance[0] + draws.mean(axis=1).var(ddof=1)
    rho = 1 - (within - covariance) / total
    rho[0] = 1.0
    limit = max((count - 1) // 2, 1)
    pairs = rho[0 : 2 * limit : 2] + rho[1 : 2 * limit : 2]
    negative = np.flatnonzero(pairs <= 0)
    kept = int(negative[0]) if negative.size else limit - 1
    time = -1 + 2 * np.minimum.accumulate(pairs[:kept]).sum() + max(rho[2 * kept], 0.0)
    return float(draws.size / max(time, 1 / np.log10(draws.size)))
