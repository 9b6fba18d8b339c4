"""Complete-linkage clusters of a population, and a rule for how many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import linkage

from mofit._typing import FloatArray
from mofit.optimize.global_search import Indices


@dataclass(frozen=True)
class Clustering:
    """Which cluster each point belongs to.

    Parameters
    ----------
    labels
        Cluster of each point, counted from 0, shape (m,).
    radii
        Mean cluster radius r(k) for k = 1 ... m clusters, shape (m,).
    """

    labels: Indices
    radii: FloatArray

    @property
    def count(self) -> int:
        """Number of clusters."""
        return int(self.labels.max()) + 1

    @property
    def radius(self) -> float:
        """Mean radius of the clusters chosen."""
        return float(self.radii[self.count - 1])


def one_cluster(size: int) -> Clustering:
    """All points in one cluster, its radius not measured (0)."""
    return Clustering(np.zeros(size, dtype=np.int64), np.zeros(size))


def cluster(points: FloatArray) -> Clustering:
    r"""Complete-linkage clusters, their number from the slope of the mean radius.

    With :math:`r(k)` the mean over the k clusters of half the complete-linkage diameter, the number of clusters is
    the largest k at which the radius still falls faster than on average,

    .. math:: k^* = \max \{k : r(k) - r(k + 1) > r(1) / (m - 1)\},

    and 1 if there is none (all points equal, or equally spaced merges).

    Parameters
    ----------
    points
        Shape (m, d), m at least 2.

    References
    ----------
    Hackl et al. (2016), section "Rastrigin function" and Figure 5. The paper gives the rule in words only; this formula
    reproduces its Table 2.
    """
    size = len(points)
    merges = linkage(points, method="complete")
    radii = _mean_radii(merges, size)
    steep = np.flatnonzero(radii[:-1] - radii[1:] > radii[0] / (size - 1))
    count = int(steep[-1]) + 1 if steep.size else 1
    return Clustering(_labels(merges, size, count), radii)


def _mean_radii(merges: FloatArray, size: int) -> FloatArray:
    """Mean cluster radius for 1 ... size clusters."""
    diameter = np.zeros(2 * size - 1)
    radii = np.zeros(size)
    total = 0.0
    for step, (left, right, height, _) in enumerate(merges):
        diameter[size + step] = height
        total += height - diameter[int(left)] - diameter[int(right)]
        remaining = size - step - 1
        radii[remaining - 1] = total / 2 / remaining
    return radii


def _labels(merges: FloatArray, size: int, count: int) -> Indices:
    """Labels after the merges that leave `count` clusters."""
    owner = np.arange(2 * size - 1)
    for step in range(size - count):
        for child in merges[step, :2].astype(int):
            owner[owner == owner[child]] = size + step
    _, labels = np.unique(owner[:size], return_inverse=True)
    return labels.astype(np.int64)
