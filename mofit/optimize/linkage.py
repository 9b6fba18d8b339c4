"""Which points of a sample start a descent: those with none better within the critical distance."""

from __future__ import annotations

from math import gamma, pi

import numpy as np
from scipy.spatial import cKDTree

from mofit._typing import FloatArray


def critical_distance(count: int, dimension: int) -> float:
    r"""Distance within which one of so many uniform points in the unit cube has, in the limit, a better one.

    .. math:: r_k = \pi^{-1/2} \left(\Gamma(1 + d/2)\, \frac{2 \ln k}{k}\right)^{1/d}
    """
    return float(pi**-0.5 * (gamma(1 + dimension / 2) * 2 * np.log(max(count, 2)) / count) ** (1 / dimension))


def linked_starts(points: FloatArray, cost: FloatArray, share: float) -> list[int]:
    """Points of the better share with none better within the critical distance, best first."""
    count, dimension = points.shape
    order = np.argsort(cost, kind="stable")[: max(1, int(share * count))]
    order = order[np.isfinite(cost[order])]
    lone = np.ones(len(order), dtype=bool)
    if len(order):
        pairs = cKDTree(points[order]).query_pairs(critical_distance(count, dimension), output_type="ndarray")
        lone[pairs.max(axis=1)] = False  # of each pair, the later one is the worse
    return [int(k) for k in order[lone]]
