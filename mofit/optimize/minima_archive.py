"""The minima that a search has found of one scalarisation: which ends are new, how many minima are undiscovered."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mofit._typing import FloatArray
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.global_search import weighted_sum

#: Least rise of a hill, as a share of the cost's interquartile range over the box: below it, rounding.
_LEAST_RISE = 1e-7
#: Where the line between two ends is evaluated: the middle decides most cases with one evaluation.
_PLACES = (np.array([0.5]), np.array([0.2, 0.35, 0.65, 0.8]))


@dataclass(frozen=True)
class Endpoint:
    """Where a descent ended: row in the log, point, cost, BFGS inverse Hessian, and the stage that started it.

    ``smooth`` says whether the gradient describes the function there: if not, no step along it led down.
    """

    row: int
    point: FloatArray
    cost: float
    inverse: FloatArray
    finished: bool
    found_by: str = ""
    smooth: bool = True


class MinimaArchive:
    """Distinct minima that a search has found of the weighted sum of the objectives.

    Parameters
    ----------
    weights
        Of the objectives, shape (T,).
    """

    #: Final inverse Hessians whose median the next descent starts from.
    REMEMBERED = 9
    #: Tabu radius: share of the median distance between nearest minima; in box widths while there are fewer than two.
    TABU_SHARE, FIRST_TABU_RADIUS = 0.35, 0.02

    def __init__(self, weights: FloatArray) -> None:
        self.weights = weights
        self.ends: list[Endpoint] = []
        self.started: set[int] = set()
        self.inverses: list[FloatArray] = []
        self.smooth: list[bool] = []
        """`Endpoint.smooth` of every descent that ended."""
        self.tabu_radius = self.FIRST_TABU_RADIUS
        """Distance from a minimum within which no other is expected."""
        self._points = np.empty((0, 0))
        self._gaps = np.empty(0)

    def cost(self, values: FloatArray) -> FloatArray:
        """Weighted sum of objective vectors (..., T); infinite where one that carries weight has failed."""
        return weighted_sum(values, self.weights)

    def gradient(self, slopes: FloatArray) -> FloatArray:
        """Gradient of that sum from gradients (..., T, d)."""
        used = self.weights > 0
        return np.asarray(np.einsum("t,...td->...d", self.weights[used], slopes[..., used, :]))

    @property
    def best(self) -> float:
        """Least cost; infinite if there is no minimum."""
        return min((end.cost for end in self.ends), default=np.inf)

    @property
    def ranked(self) -> list[Endpoint]:
        """Best first."""
        return sorted(self.ends, key=lambda end: end.cost)

    def add(self, end: Endpoint) -> None:
        """Add a minimum."""
        gaps = self.gaps(end.point)
        self._gaps = np.append(np.minimum(self._gaps, gaps), np.min(gaps, initial=np.inf))
        self._points = np.vstack([self._points.reshape(-1, len(end.point)), end.point])
        self.ends.append(end)
        if len(self.ends) > 1:
            self.tabu_radius = self.TABU_SHARE * float(np.median(self._gaps))

    def replace(self, place: int, end: Endpoint) -> None:
        """Replace a minimum by a better point of it."""
        self.ends[place] = end
        self._points[place] = end.point

    def gaps(self, point: FloatArray) -> FloatArray:
        """Distance of a point (d,) to every minimum."""
        if not self.ends:
            return np.empty(0)
        offset = self._points - point
        return np.sqrt(np.einsum("ij,ij->i", offset, offset))

    def distance(self, point: FloatArray) -> float:
        """Of a point (d,) to the nearest minimum; infinite if there is none."""
        return float(np.min(self.gaps(point), initial=np.inf))

    def nearest(self, points: FloatArray) -> NDArray[np.int64]:
        """Number of the nearest minimum to each point (N, d); 0 if there is none."""
        if not self.ends:
            return np.zeros(len(points), dtype=np.int64)
        return np.asarray(cKDTree(self._points).query(points)[1])

    def typical_inverse(self) -> FloatArray | None:
        """Element-wise median of the last inverse Hessians, made positive definite."""
        if not self.inverses:
            return None
        median = np.median(self.inverses[-self.REMEMBERED :], axis=0)
        values, vectors = np.linalg.eigh((median + median.T) / 2)
        floor = 1e-3 * max(float(values[-1]), np.finfo(float).tiny)
        return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)


def add_if_new(
    log: EvaluationLog, archive: MinimaArchive, end: Endpoint, scale: float, merge: float, found_by: str
) -> None:
    """Add the end of a descent to the archive, unless it is a known minimum.

    It is known if it lies within ``merge`` of the nearest, or if a hill-valley test (Ursem 1999; it costs evaluations)
    finds no hill between them.

    Parameters
    ----------
    log
        Evaluates the test.
    archive, end
        The minima of a scalarisation, and where a descent on it ended.
    scale
        Interquartile range of the cost over the box: a hill is measured by it.
    merge
        Ends this close are one minimum.
    found_by
        The stage of the search; a known minimum keeps the stage that found it first.
    """
    if archive.ends and not end.finished:
        return
    archive.inverses.append(end.inverse)
    archive.smooth.append(end.smooth)
    if archive.ends:
        nearest = int(np.argmin(archive.gaps(end.point)))
        known = archive.ends[nearest]
        same = bool(np.linalg.norm(known.point - end.point) < merge)
        same = same or not _hill_between(log, archive, known, end.point, end.cost, scale)
        if same:
            if end.cost < known.cost:
                archive.replace(nearest, replace(end, found_by=known.found_by))
            return
    archive.add(replace(end, found_by=found_by))


def in_known_basin(log: EvaluationLog, archive: MinimaArchive, point: FloatArray, cost: float, scale: float) -> bool:
    """Whether the cost only falls on the line from a point to the nearest known minimum (it costs evaluations).

    Ursem's test of `add_if_new` would not do: from a point high on the rim of an unknown basin no hill may be higher.
    """
    if not archive.ends:
        return False
    known = archive.ends[int(np.argmin(archive.gaps(point)))]
    path = {0.0: known.cost, 1.0: cost}
    for places in _PLACES:
        if log.left < len(places):
            return False
        _, values = log.evaluate(known.point + places[:, None] * (point - known.point))
        path |= dict(zip(places.tolist(), archive.cost(values).tolist(), strict=True))
        if np.any(np.diff([path[place] for place in sorted(path)]) < -_LEAST_RISE * scale):
            return False
    return True


def _hill_between(
    log: EvaluationLog, archive: MinimaArchive, known: Endpoint, point: FloatArray, cost: float, scale: float
) -> bool:
    """Whether a point on the line is higher than both of its ends; true if the budget does not allow the test."""
    top = max(known.cost, cost) + _LEAST_RISE * scale
    for places in _PLACES:
        if log.left < len(places):
            return True
        _, values = log.evaluate(known.point + places[:, None] * (point - known.point))
        if np.any(archive.cost(values) > top):
            return True
    return False


def expected_undiscovered(points: int, minima: int) -> float:
    r"""Posterior expectation of the number of undiscovered minima.

    .. math:: \frac{w (n - 1)}{n - w - 2} - w = \frac{w (w + 1)}{n - w - 2}

    for :math:`n` uniform points whose basins are known and belong to :math:`w` distinct minima; a priori, every number
    of minima and every division of the box among them is equally likely. Infinite while :math:`n \le w + 2`.

    Parameters
    ----------
    points
        n.
    minima
        w.

    References
    ----------
    Boender and Rinnooy Kan, "Bayesian stopping rules for multistart global optimization methods", Mathematical
    Programming 37 (1987).
    """
    return minima * (minima + 1) / (points - minima - 2) if points > minima + 2 else math.inf
