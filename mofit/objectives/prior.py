"""What earlier stages know: a Gaussian over some of the parameters, in unit coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussianPrior:
    r"""Gaussian prior over named parameters in the unit coordinates of their space.

    .. math:: -\log p(u) = \tfrac12 (u - m)^T P (u - m)

    Parameters
    ----------
    names
        The parameters it speaks of.
    mean
        Shape (k,), unit coordinates.
    precision
        Inverse covariance, shape (k, k).
    """

    names: tuple[str, ...]
    mean: Array
    precision: Array

    def spread_over(self, names: tuple[str, ...]) -> tuple[Array, Array]:
        """Mean and precision over a larger set of names; those not spoken of have precision 0."""
        index = np.array([names.index(name) for name in self.names], dtype=int)
        mean = np.full(len(names), 0.5)
        precision = np.zeros((len(names), len(names)))
        mean[index] = self.mean
        precision[np.ix_(index, index)] = self.precision
        return mean, precision


def join_priors(priors: list[GaussianPrior], names: tuple[str, ...]) -> GaussianPrior:
    """One prior over ``names`` from independent priors over disjoint subsets."""
    mean = np.full(len(names), 0.5)
    precision = np.zeros((len(names), len(names)))
    for prior in priors:
        own_mean, own_precision = prior.spread_over(names)
        index = [names.index(name) for name in prior.names]
        mean[index] = own_mean[index]
        precision += own_precision
    return GaussianPrior(names, mean, precision)
