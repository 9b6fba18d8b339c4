"""The projector onto what the parameters of a fit cannot explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted


@dataclass(frozen=True)
class Projection:
    r"""The projector :math:`M = I - J J^+` onto what the free parameters cannot explain.

    Parameters at an active bound are dropped; below the rows of the tests stand those of the prior and of the box
    (`Fitted.design`).

    Parameters
    ----------
    basis, triangle
        Q (rows, f) and R (f, f) of the QR decomposition of J.
    residual
        M r, (rows,).
    free
        Which parameters are free, (d,).
    """

    basis: FloatArray
    residual: FloatArray
    triangle: FloatArray
    free: NDArray[np.bool_]

    def apply(self, columns: FloatArray) -> FloatArray:
        """M times columns (m, k) on the rows of the tests; shape (rows, k)."""
        padded = np.zeros((len(self.basis), columns.shape[1]))
        padded[: len(columns)] = columns
        return padded - self.basis @ (self.basis[: len(columns)].T @ columns)

    def absorbed(self, column: FloatArray) -> FloatArray:
        """Shift of all parameters (d,), in unit coordinates, that compensates best for rows (m,) added to the data."""
        shift = np.zeros(len(self.free))
        shift[self.free] = np.linalg.solve(self.triangle, self.basis[: len(column)].T @ column)
        return shift

    @property
    def leverage(self) -> FloatArray:
        """Share of every row's noise that the parameters absorb, (rows,)."""
        return np.asarray(np.sum(self.basis**2, axis=1))


def project(fitted: Fitted) -> Projection:
    """The projector of a fitted hypothesis, with its residual."""
    basis, triangle = np.linalg.qr(fitted.design)
    residual = np.zeros(len(basis))
    residual[: len(fitted.residual)] = fitted.residual
    return Projection(basis, residual - basis @ (basis.T @ residual), triangle, fitted.free)
