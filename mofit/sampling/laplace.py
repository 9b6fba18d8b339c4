"""The quadratic (Laplace) model of each mode: its covariance, its posterior mass in the cube, the region it owns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from mofit._typing import FloatArray

PRIOR_PRECISION = 12.0
"""Inverse variance of the uniform distribution on [0, 1]."""
LEAST_CURVATURE = 1e-3
"""Added to the curvature in every direction: changes the log evidence by less than 0.001 d across the whole box."""
QUADRATURE_POINTS = 2048
"""Quasi-random points of the integral over the cube."""


def laplace_covariance(hessian: FloatArray) -> FloatArray:
    r"""Posterior covariance near a minimum, never wider than the box.

    .. math:: C = (H^+ + 12 I)^{-1}

    with negative eigenvalues of H set to 0. The 12 is the precision of the uniform prior on the unit cube: it is
    negligible for identified directions and caps the standard deviation of the others at 0.29.

    Parameters
    ----------
    hessian
        Hessian of the negative log posterior in unit coordinates, shape (d, d).
    """
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    covariance = (vectors / (np.maximum(values, 0.0) + PRIOR_PRECISION)) @ vectors.T
    return (covariance + covariance.T) / 2


def laplace_log_evidence(
    value: float, hessian: ArrayLike, point: ArrayLike, gradient: ArrayLike | None = None
) -> float:
    r"""Log of the posterior mass around a minimum, by a quadratic model over the unit cube.

    .. math:: \ln Z = \ln \int_{[0,1]^d} \exp(-f - g^T \Delta - \tfrac12 \Delta^T H \Delta) \, du, \quad
              \Delta = u - u_0

    For a mode far from every face this is Laplace's :math:`-f + \tfrac d2 \ln 2\pi - \tfrac12 \ln |H|`. The faces
    matter for minima at a bound (where g does not vanish) and for directions that the data don't determine, whose mass
    is that of the box. The integral over the box is computed by the GHK method with 2,048 quasi-random points.

    Parameters
    ----------
    value
        f, negative log posterior at the minimum (of any normalisation, the same for all modes).
    hessian
        H in unit coordinates, shape (d, d), positive semi-definite.
    point
        u_0, the minimum, shape (d,).
    gradient
        g at the minimum, shape (d,); zero if not given.

    References
    ----------
    Genz: Numerical computation of multivariate normal probabilities (1992).
    """
    centre = np.asarray(point, dtype=float)
    dimension = len(centre)
    slope = np.zeros(dimension) if gradient is None else np.asarray(gradient, dtype=float)
    matrix = np.asarray(hessian, dtype=float)
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    values = np.maximum(values, 0.0) + LEAST_CURVATURE
    shift = -vectors @ (vectors.T @ slope / values)  # mean of the Gaussian relative to the minimum
    low, high = -centre - shift, 1.0 - centre - shift
    # Cholesky factor of the covariance, by orthogonal steps alone: curvatures of a ridge differ by 16 decades
    upper = np.linalg.qr((vectors / values**0.5).T)[1]
    factor = upper.T * np.sign(np.diag(upper))
    log_whole = dimension / 2 * np.log(2 * np.pi) - 0.5 * float(np.sum(np.log(values)))
    return float(-value - 0.5 * slope @ shift + log_whole + _log_box_probability(factor, low, high))


def mode_weights(log_evidence: ArrayLike) -> FloatArray:
    """Share of each mode in the posterior mass of all, shape (mode,)."""
    logs = np.asarray(log_evidence, dtype=float)
    return np.asarray(np.exp(logs - logsumexp(logs)))


def mode_region(
    number: int, values: ArrayLike, centres: FloatArray, covariances: FloatArray
) -> Callable[[FloatArray], NDArray[np.bool_]]:
    r"""The region of the cube that one of several modes owns.

    .. math:: \arg\min_k \; f_k + \tfrac12 (u - c_k)^T C_k^{-1} (u - c_k) = \mathrm{number}

    Every point belongs to the mode whose quadratic model predicts the highest density there. The regions partition the
    cube: the masses of the modes in their regions add up to the whole, and no walker can enter another known mode.

    Parameters
    ----------
    number
        Index of the mode.
    values, centres, covariances
        Of all modes: negative log posterior f (K,), minimum c (K, d), Laplace covariance C (K, d, d).
    """
    heights, precisions = np.asarray(values, dtype=float), np.linalg.inv(covariances)

    def belongs(points: FloatArray) -> NDArray[np.bool_]:
        gaps = points[:, None] - centres
        predicted = heights + 0.5 * np.einsum("nki,kij,nkj->nk", gaps, precisions, gaps)
        return np.asarray(np.argmin(predicted, axis=1) == number)

    return belongs


def _log_box_probability(factor: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """Log probability that factor @ z, z standard normal, lies between low and high (GHK simulator)."""
    from scipy.stats import qmc  # late: its import takes half a second

    dimension = len(low)
    uniform = qmc.Sobol(dimension, rng=0).random(QUADRATURE_POINTS)  # fixed: a quadrature rule, not a random draw
    log_weight = np.zeros(len(uniform))
    z = np.zeros_like(uniform)
    for k in range(dimension):
        before = z[:, :k] @ factor[k, :k]
        lower, upper = (low[k] - before) / factor[k, k], (high[k] - before) / factor[k, k]
        log_mass, z[:, k] = _truncated(lower, upper, uniform[:, k])
        log_weight += log_mass
    return float(logsumexp(log_weight) - np.log(len(uniform)))


def _truncated(lower: FloatArray, upper: FloatArray, uniform: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log mass of the standard normal in [lower, upper], and its quantiles there; in the tails too."""
    mirrored = lower > 0  # work in the lower tail, where logarithms keep their digits
    lower, upper = np.where(mirrored, -upper, lower), np.where(mirrored, -lower, upper)
    log_low, log_high = log_ndtr(lower), log_ndtr(upper)
    log_mass = log_high + np.log1p(-np.exp(np.minimum(log_low - log_high, -1e-300)))
    quantile = ndtri_exp(np.minimum(np.logaddexp(log_low, np.log(uniform) + log_mass), -1e-300))
    quantile = np.clip(quantile, lower, upper)
    return log_mass, np.where(mirrored, -quantile, quantile)
