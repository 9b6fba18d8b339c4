r"""A shear that straightens a bent posterior: narrow directions follow a polynomial of the wider ones.

.. math:: y = A^T (x - m), \qquad z_k = y_k - b_k - \sum_{i < k} b_{ki} y_i - \sum_{i \le j < k} b_{kij} y_i y_j

with the axes A in descending order of the spread, and i and j among the w widest. Its Jacobian has the determinant 1:
densities keep their values, and moves in the straight coordinates z leave a target invariant as they do in x.

References
----------
Marzouk, Moselhy, Parno, Spantini: Sampling via measure transport, an introduction (2016): triangular maps.
Lange, Little, Taylor: Robust statistical modeling using the t distribution (1989).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
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
    """b, shape (d, number of monomials of the w widest directions); those of what is not wider are 0."""

    @property
    def wide(self) -> int:
        """w, how many directions others may follow."""
        return (math.isqrt(8 * self.terms.shape[1] + 1) - 3) // 2

    def straight(self, points: FloatArray) -> FloatArray:
        """Points in straight coordinates."""
        along = (points - self.centre) @ self.axes
        return np.asarray(along - monomials(along[:, : self.wide]) @ self.terms.T)

    def bent(self, straight: FloatArray) -> FloatArray:
        """The points of straight coordinates."""
        along = straight.copy()
        for rows, used in _steps(along.shape[1], self.wide):
            along[:, rows] += monomials(along[:, :used]) @ self.terms[rows, : count(used)].T
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


def fitted_bend(points: FloatArray, wide: int) -> Bend | None:
    """The bend of draws (n, d): robust regression of every direction on the wider ones; None of too few draws.

    Parameters
    ----------
    points
        The draws.
    wide
        How many directions, the widest, others may follow: 1 to d - 1.
    """
    draws, dimension = points.shape
    if not 0 < wide < dimension or draws < DRAWS_PER_TERM * count(wide):
        return None
    centre = points.mean(axis=0)
    spreads, vectors = np.linalg.eigh(np.cov(points, rowvar=False))
    axes, scale = vectors[:, ::-1], np.sqrt(np.maximum(spreads[::-1], np.finfo(float).tiny))
    y = (points - centre) @ axes / scale
    basis, size = monomials(y[:, :wide]), monomials(1 / scale[None, :wide])[0]
    weight, terms = np.ones(draws), np.zeros((dimension, basis.shape[1]))
    for _ in range(ROUNDS):
        weighted = basis * weight[:, None]
        normal, right = basis.T @ weighted + 1e-9 * draws * np.eye(len(size)), weighted.T @ y
        for rows, used in _steps(dimension, wide):
            own = slice(count(used))
            terms[rows, own] = np.linalg.solve(normal[own, own], right[own, rows]).T
        residual = y - basis @ terms.T
        residual[:, 0] -= np.average(residual[:, 0], weights=weight)
        within = np.linalg.cholesky((residual.T * weight) @ residual / draws + 1e-12 * np.eye(dimension))
        distance = np.sum(np.linalg.solve(within, residual.T) ** 2, axis=0)
        weight = (FREEDOM + dimension) / (FREEDOM + distance)
    return Bend(centre, axes, terms * size * scale[:, None])


def _steps(dimension: int, wide: int) -> Iterator[tuple[slice, int]]:
    """Directions after the widest, and how many of the widest they follow: one by one, then all others at once."""
    for k in range(1, wide):
        yield slice(k, k + 1), k
    yield slice(wide, dimension), wide
