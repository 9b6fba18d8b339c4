"""What the parameters of a fitted hypothesis leave of white rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.baseline import Fitted

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Projection:
    r"""The projector :math:`M = I - J J^+` onto what free parameters cannot explain.

    Parameters at an active bound are dropped; the prior's rows stand below those of the tests, and below them a row per
    parameter of unit weight in box widths, which keeps flat directions finite.

    Parameters
    ----------
    basis
        Orthonormal columns of J, (rows, f).
    residual
        M r, (rows,).
    freedom
        Degrees of freedom behind the noise of every row, (rows,); infinite for the prior's.
    triangle
        R of the QR decomposition, (f, f).
    free
        Which parameters are free, (d,).
    """

    basis: Array
    residual: Array
    freedom: Array
    triangle: Array
    free: NDArray[np.bool_]

    def apply(self, columns: Array) -> Array:
        """M times columns (m, k) or (m,) that live on the rows of the tests; shape (rows, k)."""
        matrix = columns.reshape(len(columns), -1)
        padded = np.zeros((len(self.basis), matrix.shape[1]))
        padded[: len(matrix)] = matrix
        left = padded - self.basis @ (self.basis[: len(matrix)].T @ matrix)
        return left.reshape(len(self.basis), *columns.shape[1:])

    def absorbed(self, column: Array) -> Array:
        """Shift of all parameters (d,), in unit coordinates, that makes up best for rows (m,) added to the data."""
        shift = np.zeros(len(self.free))
        shift[self.free] = np.linalg.solve(self.triangle, self.basis[: len(column)].T @ column)
        return shift

    @property
    def leverage(self) -> Array:
        """Share of every row's noise that the parameters take up, (rows,)."""
        return np.asarray(np.sum(self.basis**2, axis=1))


def project(fitted: Fitted) -> Projection:
    """The projector of a fitted hypothesis, with its residual."""
    free = fitted.free
    basis, triangle = np.linalg.qr(fitted.slopes(free))
    rows = fitted.hypothesis.observed.freedom
    freedom = np.full(len(basis), np.inf)
    freedom[: len(rows)] = rows
    residual = np.zeros(len(basis))
    residual[: len(fitted.residual)] = fitted.residual
    return Projection(basis, residual - basis @ (basis.T @ residual), freedom, triangle, free)
