"""What earlier stages know: a Gaussian over some of the parameters, in unit coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from mofit._typing import FloatArray


@dataclass(frozen=True)
class GaussianPrior:
    r"""Gaussian prior over named parameters in the unit coordinates of their space.

    .. math:: -\log p(u) = \tfrac12 (u - m)^T P (u - m)

    Parameters
    ----------
    names
        The parameters that it informs.
    mean
        Shape (k,), unit coordinates.
    precision
        Inverse covariance, shape (k, k).
    """

    names: tuple[str, ...]
    mean: FloatArray
    precision: FloatArray

    def over(self, names: tuple[str, ...]) -> GaussianPrior:
        """The prior over more parameters, in this order; those it does not inform have precision 0."""
        index = np.array([names.index(name) for name in self.names], dtype=int)
        mean = np.full(len(names), 0.5)
        precision = np.zeros((len(names), len(names)))
        mean[index] = self.mean
        precision[np.ix_(index, index)] = self.precision
        return GaussianPrior(names, mean, precision)

    def value(self, u: FloatArray) -> FloatArray:
        """Negative log density up to a constant, shape (N,), at points (N, k)."""
        offset = u - self.mean
        return np.asarray(0.5 * np.einsum("ni,ij,nj->n", offset, self.precision, offset))

    def gradient(self, u: FloatArray) -> FloatArray:
        """Gradient of `value`, shape (N, k)."""
        return np.asarray((u - self.mean) @ self.precision)


def inside_cube(u: FloatArray, negative_log: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Log density at points (N, k) from the negative log density of those in the unit cube, (N,).

    -inf outside the cube and where it is not finite.
    """
    result = np.full(len(u), -np.inf)
    inside = np.all((u >= 0) & (u <= 1), axis=1)
    if inside.any():
        value = negative_log(u[inside])
        result[inside] = np.where(np.isfinite(value), -value, -np.inf)
    return result


#: No prior knowledge.
FLAT = GaussianPrior((), np.empty(0), np.empty((0, 0)))


def join_priors(priors: Sequence[GaussianPrior]) -> GaussianPrior:
    """One prior from independent ones over different parameters."""
    names = tuple(name for prior in priors for name in prior.names)
    mean = np.concatenate([prior.mean for prior in priors])
    return GaussianPrior(names, mean, block_diag(*[prior.precision for prior in priors]))
