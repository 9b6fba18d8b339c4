r"""A shear that straightens a bent posterior: narrow directions follow a polynomial of the wider ones.

.. math:: y = A^T (x - m), \qquad z_k = y_k - b_k - \sum_{i < k} b_{ki} y_i - \sum_{i \le j < k} b_{kij} y_i y_j

with the axes A in descending order of the spread. Its Jacobian has the determinant 1: densities keep their values, and
moves in the straight coordinates z leave a target invariant as they do in x.

References
----------
Marzouk, Moselhy, Parno, Spantini: Sampling via measure transport, an introduction (2016): triangular maps.
Lange, Little, Taylor: Robust statistical modeling using the t distribution (1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray

ROUNDS = 8
"""Of reweighting; the fit has settled to a percent by then."""
FREEDOM = 3.0
"""Degrees of freedom of the residuals: draws far out are wide, and count less."""
DRAWS_PER_TERM = 10
"""Draws that each coefficient needs at least; with fewer it fits chance."""


@dataclass(frozen=True)
class Bend:
    """The shear of the module; points have shape (n, d)."""

    centre: FloatArray
    """m, shape (d,)."""
    axes: FloatArray
    """A, orthonormal columns, widest first, shape (d, d)."""
    terms: FloatArray
    """b, shape (d, number of monomials); those of what is not wider are 0."""

    def straight(self, points: FloatArray) -> FloatArray:
        """Points in straight coordinates."""
        along = (points - self.centre) @ self.axes
        return np.asarray(along - monomials(along) @ self.terms.T)

    def bent(self, straight: FloatArray) -> FloatArray:
        """The points of straight coordinates."""
        along = straight.copy()
        for k in range(1, along.shape[1]):  # only what is wider enters
            used = count(k)
            along[:, k] += monomials(along[:, :k]) @ self.terms[k, :used]
        return np.asarray(self.centre + along @ self.axes.T)


def count(variables: int) -> int:
    """Number of monomials up to the second degree."""
    return (variables + 1) * (variables + 2) // 2


def monomials(y: FloatArray) -> FloatArray:
    """1, y_0, y_0 y_0, y_1, y_0 y_1, y_1 y_1, ...: those of the first variables come first, (n, count)."""
    columns = [np.ones(len(y))]
    for k in range(y.shape[1]):
        columns += [y[:, k], *(y[:, i] * y[:, k] for i in range(k + 1))]
    return np.stack(columns, axis=1)


def fitted_bend(points: FloatArray) -> Bend | None:
    """The bend of draws (n, d): robust regression of every direction on the wider ones; None of too few draws."""
    draws, dimension = points.shape
    if dimension < 2 or draws < DRAWS_PER_TERM * count(dimension - 1):
        return None
    centre = points.mean(axis=0)
    spreads, vectors = np.linalg.eigh(np.cov(points, rowvar=False))
    axes, scale = vectors[:, ::-1], np.sqrt(np.maximum(spreads[::-1], np.finfo(float).tiny))
    y = (points - centre) @ axes / scale
    basis, size = monomials(y), monomials(1 / scale[None])[0]
    weight, terms = np.ones(draws), np.zeros((dimension, basis.shape[1]))
    for _ in range(ROUNDS):
        root, residual = np.sqrt(weight)[:, None], y.copy()
        for k in range(1, dimension):
            used = count(k)
            terms[k, :used] = np.linalg.lstsq(root * basis[:, :used], root[:, 0] * y[:, k], rcond=None)[0]
            residual[:, k] -= basis[:, :used] @ terms[k, :used]
        residual[:, 0] -= np.average(residual[:, 0], weights=weight)
        within = np.linalg.cholesky((residual.T * weight) @ residual / draws + 1e-12 * np.eye(dimension))
        distance = np.sum(np.linalg.solve(within, residual.T) ** 2, axis=0)
        weight = (FREEDOM + dimension) / (FREEDOM + distance)
    return Bend(centre, axes, terms * size * scale[:, None])
