"""The Gaussian around a minimum (Laplace approximation), cut off at the faces of the unit cube."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln

from mofit.parameters import Array

PRIOR_PRECISION = 12.0
"""Inverse variance of the uniform distribution on [0, 1]."""


def laplace_covariance(hessian: Array) -> Array:
    r"""Posterior covariance near a minimum, never wider than the box.

    .. math:: C = (H^+ + 12 I)^{-1}

    with negative eigenvalues of H set to 0. The 12 is the precision of the uniform prior on the unit cube: it is
    negligible where the data speak, and caps the standard deviation at 0.29 where they don't.

    Parameters
    ----------
    hessian
        Hessian of the negative log posterior in unit coordinates, shape (d, d).
    """
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    covariance = (vectors / (np.maximum(values, 0.0) + PRIOR_PRECISION)) @ vectors.T
    return (covariance + covariance.T) / 2


@dataclass(frozen=True)
class Student:
    r"""Multivariate Student-t distribution; with infinite freedom, the normal distribution.

    .. math:: \ln t(x) = \ln\frac{\Gamma((\nu + d)/2)}{\Gamma(\nu/2) (\nu\pi)^{d/2} |L|}
              - \frac{\nu + d}{2} \ln\left(1 + \frac{|L^{-1}(x - \mu)|^2}{\nu}\right), \quad L L^T = S

    Parameters
    ----------
    mean, scale
        mu (d,) and the scale matrix S (d, d), positive definite.
    freedom
        nu, degrees of freedom.
    """

    mean: Array
    scale: Array
    freedom: float = np.inf

    @cached_property
    def _factor(self) -> Array:
        return np.asarray(np.linalg.cholesky(self.scale), dtype=float)

    @cached_property
    def _whitener(self) -> Array:
        return np.asarray(np.linalg.inv(self._factor), dtype=float)

    def log_density(self, points: Array) -> Array:
        """Log density at points (n, d), shape (n,); needs a finite freedom."""
        nu, dimension = self.freedom, len(self.mean)
        distance = np.sum(((points - self.mean) @ self._whitener.T) ** 2, axis=1)
        constant = gammaln((nu + dimension) / 2) - gammaln(nu / 2) - dimension / 2 * np.log(nu * np.pi)
        log_determinant = np.sum(np.log(np.diag(self._factor)))
        return np.asarray(constant - log_determinant - (nu + dimension) / 2 * np.log1p(distance / nu))

    def draw_inside(self, random: np.random.RandomState, count: int, rounds: int = 64) -> Array:
        """Draws cut off at the faces of the unit cube, shape (count, d), from emcee's kind of generator.

        Draws outside are replaced, up to `rounds` times; what is outside even then is returned as it is. Up to a
        constant, the density inside is thus that of the whole distribution.
        """
        draws = np.empty((count, len(self.mean)))
        missing = np.arange(count)
        for _ in range(rounds):
            steps = random.standard_normal((len(missing), len(self.mean))) @ self._factor.T
            if np.isfinite(self.freedom):
                steps /= np.sqrt(random.chisquare(self.freedom, len(missing)) / self.freedom)[:, None]
            draws[missing] = self.mean + steps
            missing = missing[np.any((draws[missing] < 0) | (draws[missing] > 1), axis=1)]
            if missing.size == 0:
                break
        return draws
