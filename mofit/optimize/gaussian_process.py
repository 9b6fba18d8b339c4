"""Gaussian-process regression of several outputs that share their length scales."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from mofit._typing import FloatArray

#: Added to the correlation matrix's diagonal: keeps it positive definite, allows for rounding in simulations.
NUGGET = 1e-6
#: Median and log standard deviation of the length scales' log-normal prior, in box widths.
PRIOR_LENGTH, PRIOR_SD = 0.2, 1.0
#: Bounds of a length scale, in box widths.
SHORTEST, LONGEST = 0.02, 10.0


@dataclass(frozen=True)
class GaussianProcess:
    r"""Posterior of functions evaluated at points of the unit cube.

    .. math:: y_t(u) = \mu_t + z_t(u), \qquad \operatorname{cov}(z_t(u), z_t(u')) = \sigma_t^2
              \exp\Bigl(-\tfrac12 \sum_j (u_j - u'_j)^2 / \ell_j^2\Bigr)

    with one set of length scales, and so one factorisation, for all outputs.

    Parameters
    ----------
    points, values
        Shapes (n, d) and (n, T).
    lengths
        :math:`\ell`, shape (d,).
    """

    points: FloatArray
    values: FloatArray
    lengths: FloatArray

    @cached_property
    def _factor(self) -> FloatArray:
        return np.asarray(cholesky(correlation(self.points, self.points, self.lengths) + _nugget(self.points), True))

    @cached_property
    def centre(self) -> FloatArray:
        """Generalised least-squares mean of every output, shape (T,)."""
        ones = cho_solve((self._factor, True), np.ones(len(self.points)))
        return np.asarray(ones @ self.values / ones.sum())

    @cached_property
    def _coefficients(self) -> FloatArray:
        return np.asarray(cho_solve((self._factor, True), self.values - self.centre))

    @cached_property
    def scale(self) -> FloatArray:
        """Standard deviation of every output over the box, shape (T,)."""
        residual = self.values - self.centre
        return np.sqrt(np.maximum(np.einsum("nt,nt->t", residual, self._coefficients) / len(self.points), 1e-300))

    def mean(self, u: FloatArray) -> FloatArray:
        """Posterior mean at points (N, d), shape (N, T)."""
        return np.asarray(self.centre + correlation(u, self.points, self.lengths) @ self._coefficients)

    def mean_and_slope(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Posterior mean (N, T) and its gradient (N, T, d)."""
        near = correlation(u, self.points, self.lengths)
        pull = near[:, None] * self._coefficients.T  # (N, T, n): of every point on every output
        slope = (pull @ self.points - pull.sum(axis=-1, keepdims=True) * u[:, None]) / self.lengths**2
        return np.asarray(self.centre + pull.sum(axis=-1)), np.asarray(slope)

    def deviation(self, u: FloatArray) -> FloatArray:
        """Posterior standard deviation relative to `scale`, shape (N,): 0 at evaluated points, 1 far from all."""
        near = correlation(u, self.points, self.lengths)
        known = solve_triangular(self._factor, near.T, lower=True)
        return np.sqrt(np.maximum(1 - np.sum(known**2, axis=0), 0.0))


def fit_lengths(
    points: FloatArray, values: FloatArray, rng: np.random.Generator, start: FloatArray | None = None
) -> FloatArray:
    """Length scales of greatest posterior density, shape (d,): from the start given and two random ones.

    Parameters
    ----------
    points, values
        Shapes (n, d) and (n, T).
    rng
        Draws starts.
    start
        Length scales of an earlier fit.
    """
    dimension = points.shape[1]
    squares = (points[:, None] - points[None]) ** 2
    starts = [np.log(PRIOR_LENGTH) + PRIOR_SD / 2 * rng.normal(size=dimension) for _ in range(2)]
    starts.append(np.full(dimension, np.log(PRIOR_LENGTH)) if start is None else np.log(start))
    bounds = [(np.log(SHORTEST), np.log(LONGEST))] * dimension
    fits = [
        minimize(negative_log_posterior, begin, (squares, values), "L-BFGS-B", jac=True, bounds=bounds,
                 options={"maxiter": 40})
        for begin in starts
    ]  # fmt: skip
    return np.exp(min(fits, key=lambda fit: float(fit.fun)).x)


def negative_log_posterior(
    log_lengths: FloatArray, squares: FloatArray, values: FloatArray
) -> tuple[float, FloatArray]:
    """Negative log posterior of the log length scales, the outputs' scales and means profiled out, and its gradient."""
    count, outputs = values.shape
    inverse_squares = np.exp(-2 * log_lengths)
    correlation = np.exp(-0.5 * squares @ inverse_squares)
    try:
        factor = cholesky(correlation + NUGGET * np.eye(count), lower=True)
    except np.linalg.LinAlgError:
        return 1e10, np.zeros_like(log_lengths)
    inverse = cho_solve((factor, True), np.eye(count))
    ones = inverse.sum(axis=1)
    residual = values - ones @ values / ones.sum()
    coefficients = inverse @ residual
    level = np.maximum(np.einsum("nt,nt->t", residual, coefficients) / count, 1e-300)
    value = 0.5 * count * float(np.sum(np.log(level))) + outputs * float(np.sum(np.log(np.diag(factor))))
    weight = (0.5 * outputs * inverse - 0.5 * (coefficients / level) @ coefficients.T) * correlation
    gradient = np.einsum("nm,nmd->d", weight, squares) * inverse_squares
    offset = log_lengths - np.log(PRIOR_LENGTH)
    return value + 0.5 * float(offset @ offset) / PRIOR_SD**2, gradient + offset / PRIOR_SD**2


def correlation(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    """Of points (n, d) with others (m, d), (n, m)."""
    a, b = a / lengths, b / lengths
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1)[None] - 2 * a @ b.T
    return np.exp(-0.5 * np.maximum(squares, 0.0))


def _nugget(points: FloatArray) -> FloatArray:
    return NUGGET * np.eye(len(points))
