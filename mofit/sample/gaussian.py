"""The Gaussian around a minimum (Laplace approximation)."""

from __future__ import annotations

import numpy as np

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
