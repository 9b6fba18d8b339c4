r"""A response surface: smooth functions of a few coordinates from values at scattered points.

.. math:: c(z) = \sum_{|\alpha| \le q} \beta_\alpha z^\alpha + g(z)

with a polynomial of degree q fitted by least squares and, where that helps, a Gaussian process g through what it
leaves. Degree and process are those of least leave-one-out error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from mofit._typing import FloatArray
from mofit.optimize.gaussian_process import NUGGET, correlation, fit_lengths

#: Points per coefficient of a polynomial, at least.
PER_COEFFICIENT = 1.3
DEGREES = (1, 2, 3)
#: Columns with less of the largest remainder do not help to find the lengths of the process.
_LOUD = 1e-2
#: By so much the process must lower the error: it has lengths to fit, and the polynomial has not.
_BETTER = 0.7


def coefficients(dimension: int, degree: int) -> int:
    """Number of coefficients of a polynomial."""
    return len(_exponents(dimension, degree))


@dataclass(frozen=True)
class Process:
    """The mean of a Gaussian process through what a polynomial leaves at points (K, d) of the unit cube."""

    points: FloatArray
    coefficients: FloatArray
    """Shape (K, M)."""
    lengths: FloatArray
    """Shape (d,)."""

    def __call__(self, u: FloatArray) -> FloatArray:
        """Values (N, M) at points (N, d)."""
        return np.asarray(correlation(u, self.points, self.lengths) @ self.coefficients)

    def with_slopes(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (N, M) and their derivatives (N, M, d)."""
        near = correlation(u, self.points, self.lengths)
        offset = (self.points[None] - u[:, None]) / self.lengths**2
        slopes = np.einsum("nk,nkd,km->nmd", near, offset, self.coefficients, optimize=True)
        return np.asarray(near @ self.coefficients), np.asarray(slopes)


@dataclass(frozen=True)
class Surface:
    """Functions of z (N, d) with values (N, M)."""

    exponents: NDArray[np.int64]
    """Shape (coefficients, d)."""
    beta: FloatArray
    """Shape (coefficients, M)."""
    process: Process | None
    """Of what the polynomial leaves, in the unit cube around the points; None where it leaves nothing worth it."""
    extent: float
    """Largest coordinate of a point: the cube of the process reaches so far."""
    error: float
    """Root mean square of the leave-one-out errors, all functions together."""

    @classmethod
    def fitted(cls, z: FloatArray, values: FloatArray, rng: np.random.Generator) -> Surface:
        """The surface through values (K, M) at points (K, d).

        Raises
        ------
        ValueError
            If there are too few points for a plane.
        """
        dimension, found = z.shape[1], None
        extent = float(np.abs(z).max()) or 1.0
        for degree in DEGREES:
            exponents = _exponents(dimension, degree)
            if len(z) < PER_COEFFICIENT * len(exponents):
                break
            basis = _monomials(z, exponents)
            q, r = np.linalg.qr(basis)
            beta = np.linalg.lstsq(r, q.T @ values, rcond=1e-12)[0]
            left = values - basis @ beta
            free = np.maximum(1.0 - np.sum(q**2, axis=1), 1e-6)[:, None]
            error = _norm(left / free)
            if found is None or error < found.error:
                found = cls(exponents, beta, None, extent, error)
        if found is None:
            raise ValueError(f"{len(z)} points are too few for {dimension} coordinates")
        return found._with_process(z, values, rng)

    def _with_process(self, z: FloatArray, values: FloatArray, rng: np.random.Generator) -> Surface:
        """With the process, if it lowers the error: universal kriging, its errors with polynomial and process anew."""
        basis = _monomials(z, self.exponents)
        left = values - basis @ self.beta
        size = np.sqrt(np.mean(left**2, axis=0))
        if not size.max() > 0:
            return self
        cube = self._cube(z)
        lengths = fit_lengths(cube, left[:, size > _LOUD * size.max()], rng)
        factor = cho_factor(correlation(cube, cube, lengths) + NUGGET * np.eye(len(z)))
        inverse, solved = cho_solve(factor, np.eye(len(z))), cho_solve(factor, basis)
        normal = cho_factor(basis.T @ solved)
        projected = inverse - solved @ cho_solve(normal, solved.T)
        error = _norm(projected @ values / np.diag(projected)[:, None])
        if not error < _BETTER * self.error:
            return self
        beta = cho_solve(normal, solved.T @ values)
        process = Process(cube, cho_solve(factor, values - basis @ beta), lengths)
        return Surface(self.exponents, beta, process, self.extent, error)

    def _cube(self, z: FloatArray) -> FloatArray:
        return np.asarray(0.5 + z / (2 * self.extent))

    def __call__(self, z: FloatArray) -> FloatArray:
        """Values (N, M)."""
        values = _monomials(z, self.exponents) @ self.beta
        return values if self.process is None else values + self.process(self._cube(z))

    def with_slopes(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (N, M) and their derivatives (N, M, d)."""
        values = _monomials(z, self.exponents) @ self.beta
        slopes = np.stack(
            [_monomials(z, *_differentiated(self.exponents, k)) @ self.beta for k in range(z.shape[1])], -1
        )
        if self.process is None:
            return values, slopes
        mean, gradient = self.process.with_slopes(self._cube(z))
        return values + mean, slopes + gradient / (2 * self.extent)


def _exponents(dimension: int, degree: int) -> NDArray[np.int64]:
    chosen: list[Sequence[int]] = [
        which for order in range(degree + 1) for which in combinations_with_replacement(range(dimension), order)
    ]
    return np.array([[which.count(k) for k in range(dimension)] for which in map(tuple, chosen)], dtype=np.int64)


def _monomials(z: FloatArray, exponents: NDArray[np.int64], factors: FloatArray | None = None) -> FloatArray:
    """Monomials at points (N, d), times factors, (N, coefficients)."""
    found = np.ones((len(z), len(exponents)))
    powers = [np.ones_like(z), z, z**2, z**3]
    for k in range(z.shape[1]):
        column = np.stack([power[:, k] for power in powers], axis=1)
        found *= column[:, exponents[:, k]]
    return found if factors is None else found * factors


def _differentiated(exponents: NDArray[np.int64], k: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Exponents and factors of the monomials' derivatives by one coordinate."""
    lower = exponents.copy()
    lower[:, k] = np.maximum(lower[:, k] - 1, 0)
    return lower, exponents[:, k].astype(float)


def _norm(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))
