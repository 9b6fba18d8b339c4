"""How much posterior mass a mode holds (Laplace approximation, cut off at the faces of the unit cube)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from mofit.parameters import Array
from mofit.sobol import sobol

LEAST_CURVATURE = 1e-3
"""Added to the curvature in every direction: changes the value by less than 0.001 d across the whole box."""


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
    curvature = np.asarray(hessian, dtype=float) + LEAST_CURVATURE * np.eye(dimension)
    shift = -np.linalg.solve(curvature, slope)  # mean of the Gaussian relative to the minimum
    low, high = -centre - shift, 1.0 - centre - shift
    factor = np.linalg.cholesky(np.linalg.inv(curvature))
    log_whole = dimension / 2 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(curvature)[1]
    return float(-value - 0.5 * slope @ shift + log_whole + _log_box_probability(factor, low, high))


def mode_weights(log_evidence: ArrayLike) -> Array:
    """Share of each mode in the posterior mass of all, shape (mode,)."""
    logs = np.asarray(log_evidence, dtype=float)
    return np.asarray(np.exp(logs - logsumexp(logs)))


def _log_box_probability(factor: Array, low: Array, high: Array) -> float:
    """Log probability that factor @ z, z standard normal, lies between low and high (GHK simulator)."""
    dimension = len(low)
    uniform = sobol(dimension, 0).random(2048)  # fixed: a quadrature rule, not a random draw
    log_weight = np.zeros(len(uniform))
    z = np.zeros_like(uniform)
    for k in range(dimension):
        before = z[:, :k] @ factor[k, :k]
        lower, upper = (low[k] - before) / factor[k, k], (high[k] - before) / factor[k, k]
        log_mass, z[:, k] = _truncated(lower, upper, uniform[:, k])
        log_weight += log_mass
    return float(logsumexp(log_weight) - np.log(len(uniform)))


def _truncated(lower: Array, upper: Array, uniform: Array) -> tuple[Array, Array]:
    """Log mass of the standard normal in [lower, upper], and its quantiles there; in the tails too."""
    mirrored = lower > 0  # work in the lower tail, where logarithms keep their digits
    lower, upper = np.where(mirrored, -upper, lower), np.where(mirrored, -lower, upper)
    log_low, log_high = log_ndtr(lower), log_ndtr(upper)
    log_mass = log_high + np.log1p(-np.exp(np.minimum(log_low - log_high, -1e-300)))
    quantile = ndtri_exp(np.minimum(np.logaddexp(log_low, np.log(uniform) + log_mass), -1e-300))
    quantile = np.clip(quantile, lower, upper)
    return log_mass, np.where(mirrored, -quantile, quantile)
