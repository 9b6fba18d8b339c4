r"""A likelihood that is as wide as its estimate scatters: curvature adjustment.

Summed squares :math:`q_0(u) = \sum_t w_t C_t(u)` take residuals as independent and equally large. The estimate that
minimises them is sound all the same, but scatters with the covariance :math:`H^{-1} J H^{-1}` (H: curvature of
:math:`q_0 / 2`; J: covariance of its slope under the true noise), not :math:`H^{-1}`. The adjusted likelihood takes
the squares at a point that is drawn towards the minimum,

.. math::
    q(u) = \kappa \, [q_0(u_0 + T (u - u_0)) - q_0(u_0)], \quad
    T = (\kappa H)^{-1/2} (H^{1/2} P H^{1/2})^{1/2} H^{-1/2}, \quad P = H J^{-1} H,

so that its curvature is :math:`P`, while bounds, priors and the shape far from the minimum stay those of the model. Of
all linear maps that do this, T moves the points of the posterior least on average (optimal transport between
Gaussians): it is symmetric, and cannot shear the box where H hardly knows a direction. :math:`\kappa` is the largest
for which no direction is stretched.

References
----------
Ribatet, Cooley & Davison, "Bayesian inference from composite likelihoods", Statistica Sinica 22 (2012).
Dowson & Landau, "The Fréchet distance between multivariate normal distributions", J. Multivariate Analysis 12 (1982).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from mofit._typing import FloatArray

#: Quantile at the upper end of a 90 % interval.
_UPPER_END = 0.95
#: Curvature below this share of the largest is that of a flat direction.
_FLAT = 1e-12
#: Degrees of freedom of what is known exactly.
_EXACT = 1e6


@dataclass(frozen=True)
class Score:
    """Gradient, curvature and covariance of the gradient (J) of every objective at a point."""

    slope: FloatArray
    """w_t times the gradient of C_t / 2, shape (T, d)."""
    normal: FloatArray
    """w_t times the Gauss-Newton matrix, (T, d, d)."""
    noise: FloatArray
    """Covariance of the slope by noise, (T, d, d)."""
    gap: FloatArray
    """Covariance of the slope by what the model misses, (T, d, d)."""
    freedom: FloatArray
    """Degrees of freedom behind the noise of each objective, (T,)."""
    gap_freedom: float
    """Those behind the gap."""
    gap_squares: tuple[float, float] = (0.0, 0.0)
    """Mean squared amplitude of the gap on the fundamentals and on the harmonics, relative to the output's range."""
    memory: FloatArray = field(default_factory=lambda: np.zeros((0, 1)))
    """What the record of each objective tells of long memory in its noise, (T, M)."""

    def for_a_normal(self) -> Score:
        """The same with the noise so large that normal intervals (90 %) are as wide as those of the t distributions.

        A noise whose power is known from few lines has a t distribution. Each objective counts by its own degrees of
        freedom: where as many are fitted as parameters, none makes up for another.
        """
        return replace(self, noise=self.noise * normal_variance(self.freedom)[:, None, None])

    def embedded(self, index: FloatArray, jacobian: FloatArray, dimension: int) -> Score:
        """The same in a larger space: own coordinates at ``index``, d(own) / d(larger) = ``jacobian``."""
        place = np.zeros((len(index), dimension))
        place[np.arange(len(index)), index] = jacobian

        def matrices(own: FloatArray) -> FloatArray:
            return np.asarray(place.T @ own @ place)

        return replace(
            self,
            slope=self.slope @ place,
            normal=matrices(self.normal),
            noise=matrices(self.noise),
            gap=matrices(self.gap),
        )


def normal_variance(freedom: ArrayLike) -> FloatArray:
    """Variance of the normal distribution whose 90 % interval is that of a t distribution of scale 1."""
    return np.asarray((stdtrit(freedom, _UPPER_END) / stdtrit(np.inf, _UPPER_END)) ** 2)


def join_scores(scores: list[Score]) -> Score:
    """All tests of several problems; freedom and size of the gap are the first one's."""
    per_test = ("slope", "normal", "noise", "gap", "freedom", "memory")
    together: dict[str, Any] = {name: np.concatenate([getattr(score, name) for score in scores]) for name in per_test}
    return replace(scores[0], **together)


@dataclass(frozen=True)
class Adjustment:
    """The map and the constants of the adjusted likelihood around one minimum; see the module."""

    centre: FloatArray
    map: FloatArray
    scale: float
    linear: FloatArray
    precision: FloatArray
    freedom: float

    def mapped(self, u: FloatArray) -> FloatArray:
        """Where the squares are taken for points (N, d)."""
        return np.asarray(self.centre + (u - self.centre) @ self.map.T)

    def value(self, change: FloatArray, u: FloatArray) -> FloatArray:
        r"""Negative log likelihood relative to the centre, (N,), from the change of the squares :math:`q_0` there.

        The noise was estimated with :math:`\nu` degrees of freedom:
        :math:`\tfrac{\nu + d}{2} \log(1 + q / \nu)` in place of :math:`q / 2`.
        """
        square = self._square(change, u)
        return np.asarray(0.5 * (self.freedom + len(self.centre)) * np.log1p(square / self.freedom))

    def slope(self, change: FloatArray, u: FloatArray) -> FloatArray:
        """Derivative of `value` with respect to q, (N,)."""
        return np.asarray(0.5 * (self.freedom + len(self.centre)) / (self.freedom + self._square(change, u)))

    def _square(self, change: FloatArray, u: FloatArray) -> FloatArray:
        square = self.scale * change + 2 * (u - self.centre) @ self.linear
        return np.maximum(square, -0.5 * self.freedom)


def adjust(score: Score, centre: FloatArray, with_gap: bool, mapped: bool = True) -> Adjustment:
    r"""The adjustment at a minimum (d,) for noise alone, or for noise and gap.

    A linear map would distort a valley that bends. There (not ``mapped``) T is the identity and :math:`\kappa` such
    that no direction is narrower than by P: intervals that are too wide rather than wrong.
    """
    dimension = len(centre)
    normal, slope = score.normal.sum(axis=0), score.slope.sum(axis=0)
    if not normal.any():  # nothing moves the squares: all that is free are means and spreads of populations
        return Adjustment(centre, np.eye(dimension), 1.0, np.zeros(dimension), np.zeros_like(normal), _EXACT)
    parts = [*score.noise, *(score.gap if with_gap else [])]
    freedoms = np.array([*score.freedom, *([score.gap_freedom] * len(score.gap) if with_gap else [])])
    scatter = np.sum(parts, axis=0)
    ratio = np.trace(scatter) / max(float(np.trace(normal)), np.finfo(float).tiny)
    flat = _FLAT * np.trace(normal) / dimension + np.finfo(float).tiny
    normal, scatter = normal + flat * np.eye(dimension), scatter + ratio * flat * np.eye(dimension)
    values, vectors = np.linalg.eigh(normal)
    values = np.maximum(values, flat)
    root, inverse_root = (vectors * values**0.5) @ vectors.T, (vectors * values**-0.5) @ vectors.T
    spreads, axes = np.linalg.eigh(inverse_root @ scatter @ inverse_root)
    spreads = np.maximum(spreads, 1e-6 * spreads.max())
    if mapped:
        half = (axes * spreads**-0.5).T @ root
        precision = half.T @ half
        _, sizes, turned = np.linalg.svd(half @ root)
        matrix = inverse_root @ (turned.T * sizes) @ turned @ inverse_root
        largest = float(np.linalg.eigvalsh(matrix)[-1])
        matrix, scale = matrix / largest, largest**2
    else:
        scale = 1 / float(spreads.max())
        matrix, precision = np.eye(dimension), scale * normal
    wanted = precision @ np.linalg.solve(normal, slope)
    return Adjustment(
        centre=centre,
        map=matrix,
        scale=scale,
        linear=wanted - scale * matrix.T @ slope,
        precision=precision,
        freedom=_freedom(parts, freedoms, inverse_root),
    )


def _freedom(parts: list[FloatArray], freedoms: FloatArray, inverse_root: FloatArray) -> float:
    """Of a sum of estimated covariances (Satterthwaite), on average over the directions."""
    shares = np.array([np.trace(inverse_root @ part @ inverse_root) for part in parts])
    total = float(np.sum(shares**2 / freedoms))
    return float(np.sum(shares) ** 2 / total) if total > 0 else _EXACT
