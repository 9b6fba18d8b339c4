"""Mixtures of multivariate Student-t distributions: independence proposals whose tails forgive a poor fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln, logsumexp

from mofit.parameters import Array


@dataclass(frozen=True)
class Students:
    r"""Mixture of multivariate Student-t distributions.

    .. math:: q(x) = \sum_k w_k\, \frac{\Gamma((\nu + d)/2)}{\Gamma(\nu/2) (\nu\pi)^{d/2} |L_k|}
              \left(1 + \frac{|L_k^{-1}(x - \mu_k)|^2}{\nu}\right)^{-(\nu + d)/2}, \quad L_k L_k^T = S_k

    Parameters
    ----------
    weights
        w, shape (K,), of sum 1.
    means, scales
        mu (K, d) and the scale matrices S (K, d, d), positive definite.
    freedom
        nu, degrees of freedom.
    """

    weights: Array
    means: Array
    scales: Array
    freedom: float

    @classmethod
    def single(cls, mean: Array, scale: Array, freedom: float) -> Students:
        """One component, mean (d,) and scale matrix (d, d)."""
        return cls(np.ones(1), np.asarray(mean, dtype=float)[None], np.asarray(scale, dtype=float)[None], freedom)

    @cached_property
    def _factors(self) -> Array:
        return np.asarray(np.linalg.cholesky(self.scales), dtype=float)

    @cached_property
    def _whiteners(self) -> Array:
        return np.asarray(np.linalg.inv(self._factors), dtype=float)

    @cached_property
    def _constants(self) -> Array:
        nu, dimension = self.freedom, self.means.shape[1]
        peak = gammaln((nu + dimension) / 2) - gammaln(nu / 2) - dimension / 2 * np.log(nu * np.pi)
        determinants = np.sum(np.log(np.diagonal(self._factors, axis1=1, axis2=2)), axis=1)
        return np.asarray(np.log(self.weights) + peak - determinants)

    def log_density(self, points: Array) -> Array:
        """Log density at points (n, d), shape (n,)."""
        gaps = points[None] - self.means[:, None]
        distance = np.sum((gaps @ self._whiteners.transpose(0, 2, 1)) ** 2, axis=2)
        logs = self._constants[:, None] - (self.freedom + points.shape[1]) / 2 * np.log1p(distance / self.freedom)
        return np.asarray(logs[0] if len(logs) == 1 else logsumexp(logs, axis=0))

    def draw(self, random: np.random.RandomState, count: int) -> Array:
        """Draws, shape (count, d), from emcee's kind of generator."""
        shape = count, self.means.shape[1]
        which = np.searchsorted(np.cumsum(self.weights)[:-1], random.random_sample(count), side="right")
        steps = random.standard_normal(shape)
        for k in range(len(self.weights)):
            steps[which == k] = steps[which == k] @ self._factors[k].T
        stretch = np.sqrt(random.chisquare(self.freedom, count) / self.freedom)
        return np.asarray(self.means[which] + steps / stretch[:, None])

    def draw_inside(self, random: np.random.RandomState, count: int, rounds: int = 64) -> Array:
        """Draws cut off at the faces of the unit cube, shape (count, d).

        Draws outside are replaced, up to `rounds` times; what is outside even then is returned as it is. Up to a
        constant, the density inside is thus that of the whole distribution.
        """
        draws = self.draw(random, count)
        for _ in range(rounds - 1):
            missing = np.flatnonzero(np.any((draws < 0) | (draws > 1), axis=1))
            if missing.size == 0:
                break
            draws[missing] = self.draw(random, len(missing))
        return draws
