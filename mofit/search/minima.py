"""The minima of one scalarisation that a search has found so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mofit.parameters import Array


@dataclass(frozen=True)
class End:
    """Where a polish ended: the row of the point, the cost there, and the inverse Hessian as BFGS knows it."""

    row: int
    point: Array
    cost: float
    inverse: Array


class Minima:
    """Distinct minima of the weighted sum of the objectives.

    Parameters
    ----------
    weights
        Of the objectives, shape (T,).
    """

    #: final inverse Hessians that the next polish starts from the median of
    REMEMBERED = 9
    #: exclusion radius: share of the median distance between nearest minima, and while there are fewer than two
    EXCLUSION, FIRST_EXCLUSION = 0.35, 0.02

    def __init__(self, weights: Array) -> None:
        self.weights = weights
        self.ends: list[End] = []
        self.started: set[int] = set()
        self.inverses: list[Array] = []
        self.exclusion = self.FIRST_EXCLUSION
        """Radius round a minimum in which no further one is expected."""
        self._points = np.empty((0, 0))
        self._gaps = np.empty(0)

    def cost(self, values: Array) -> Array:
        """Weighted sum of objective vectors (..., T); infinite where one that carries weight has failed."""
        used = self.weights > 0
        total = values[..., used] @ self.weights[used]
        return np.asarray(np.where(np.isfinite(total), total, np.inf))

    def slope(self, slopes: Array) -> Array:
        """Gradient of that sum from gradients (..., T, d)."""
        used = self.weights > 0
        return np.asarray(np.einsum("t,...td->...d", self.weights[used], slopes[..., used, :]))

    @property
    def best(self) -> float:
        """Least cost; infinite if there is no minimum."""
        return min((end.cost for end in self.ends), default=np.inf)

    @property
    def ranked(self) -> list[End]:
        """Best first."""
        return sorted(self.ends, key=lambda end: end.cost)

    def add(self, end: End) -> None:
        """One more minimum."""
        gaps = self.gaps(end.point)
        self._gaps = np.append(np.minimum(self._gaps, gaps), np.min(gaps, initial=np.inf))
        self._points = np.vstack([self._points.reshape(-1, len(end.point)), end.point])
        self.ends.append(end)
        if len(self.ends) > 1:
            self.exclusion = self.EXCLUSION * float(np.median(self._gaps))

    def replace(self, place: int, end: End) -> None:
        """A better point of a known minimum."""
        self.ends[place] = end
        self._points[place] = end.point

    def gaps(self, point: Array) -> Array:
        """Distance of a point (d,) to every minimum."""
        if not self.ends:
            return np.empty(0)
        offset = self._points - point
        return np.sqrt(np.einsum("ij,ij->i", offset, offset))

    def distance(self, point: Array) -> float:
        """Of a point (d,) to the nearest minimum; infinite if there is none."""
        return float(np.min(self.gaps(point), initial=np.inf))

    def nearest(self, points: Array) -> NDArray[np.int64]:
        """Number of the nearest minimum to each point (N, d); 0 if there is none."""
        if not self.ends:
            return np.zeros(len(points), dtype=np.int64)
        return np.asarray(cKDTree(self._points).query(points)[1])

    def typical_inverse(self) -> Array | None:
        """Element-wise median of the last inverse Hessians, made positive definite."""
        if not self.inverses:
            return None
        median = np.median(self.inverses[-self.REMEMBERED :], axis=0)
        values, vectors = np.linalg.eigh((median + median.T) / 2)
        floor = 1e-3 * max(float(values[-1]), np.finfo(float).tiny)
        return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)
