"""Profile likelihood: how well the data fit if one parameter is held off its best value and all others may answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.parameters import Array
from mofit.refine.step import box_step

POINTS = 13
REACH = 3.0
"""Grid points per parameter, and how many standard deviations they reach to either side: 99.7 % of a Gaussian."""

ITERATIONS = 60
"""Gauss-Newton needs a few from the start on the linearised path; curved valleys need tens."""
DECREASE = 1e-6
"""Predicted decrease (nats) below which a grid point is done: invisible beside the 1.35 that bound a 90 % interval."""
STALLED = 1e-3
"""Where rounding stops all progress, a predicted decrease (nats) below this still counts as converged."""
_DAMPING, _LEAST, _MOST = 1e-3, 1e-9, 1e12
_STRIDE = 0.25
_ACCEPT = 1e-4


class Smooth(Protocol):
    """A problem whose negative log posterior has derivatives."""

    def evaluate(self, u: Array, /) -> tuple[Array, Array, Array]:
        """Value (N,), gradient (N, d) and Gauss-Newton Hessian (N, d, d) at points of the unit cube (N, d)."""
        ...


@dataclass(frozen=True)
class Profile:
    """Profiles of d parameters at P grid points each.

    Parameters
    ----------
    points
        The constrained minima in the unit cube, shape (d, P, d); ``points[k, :, k]`` is the grid of parameter k.
    nll
        Negative log posterior there relative to the minimum, in nats, shape (d, P); nan where the model fails.
    converged
        Whether the others reached their minimum, shape (d, P).
    """

    points: Array
    nll: Array
    converged: NDArray[np.bool_]

    @property
    def grid(self) -> Array:
        """Held values in the unit cube, shape (d, P)."""
        return np.asarray(np.diagonal(self.points, axis1=0, axis2=2).T)


def profile(
    problem: Smooth, minimum_point: ArrayLike, sd: ArrayLike, points: int = POINTS, reach: float = REACH
) -> Profile:
    r"""Profile the negative log posterior over every parameter.

    .. math:: f_k(c) = \min_{u \in [0,1]^d,\; u_k = c} f(u) - f(u^*)

    on a grid of c from :math:`u^*_k - r \sigma_k` to :math:`u^*_k + r \sigma_k` within the box, u* among its points.
    All grid points of all parameters are minimised together by damped Gauss-Newton steps (Levenberg-Marquardt inside
    the box), from where the quadratic model at the minimum expects the others.

    Parameters
    ----------
    problem
        Anything with a batched `evaluate`.
    minimum_point
        u*, shape (d,).
    sd
        Standard deviations in the unit cube, shape (d,), from the Laplace approximation, say.
    points
        Grid points per parameter, P.
    reach
        r, standard deviations to either side.

    References
    ----------
    Raue et al.: Structural and practical identifiability analysis of partially observed dynamical models by exploiting
    the profile likelihood, Bioinformatics 25 (2009).
    """
    centre = np.asarray(minimum_point, dtype=float)
    value, _, hessian = problem.evaluate(centre[None])
    grid = _grid(centre, np.asarray(sd, dtype=float), points, reach)
    held = np.repeat(np.eye(len(centre), dtype=bool), points, axis=0)
    ends, values, converged = _minimise(problem, _starts(centre, hessian[0], grid), centre, held)
    shape = grid.shape
    return Profile(ends.reshape(*shape, -1), values.reshape(shape) - value[0], converged.reshape(shape))


def _grid(centre: Array, sd: Array, points: int, reach: float) -> Array:
    """Evenly spaced values inside the box, the nearest one moved onto the minimum; shape (d, P)."""
    low, high = np.clip(centre - reach * sd, 0.0, 1.0), np.clip(centre + reach * sd, 0.0, 1.0)
    grid = np.linspace(low, high, points, axis=1)
    nearest = np.argmin(np.abs(grid - centre[:, None]), axis=1)
    grid[np.arange(len(centre)), nearest] = centre
    return grid


def _starts(centre: Array, hessian: Array, grid: Array) -> Array:
    r"""Where the quadratic model expects the others, :math:`-H_{oo}^{-1} H_{ok} (c - u^*_k)`; shape (d P, d)."""
    dimension, points = grid.shape
    starts = np.repeat(np.tile(centre, (dimension, 1))[:, None, :], points, axis=1)
    for k in range(dimension):
        others = np.arange(dimension) != k
        answer = np.zeros(dimension)
        answer[k] = 1.0
        if dimension > 1:
            inner = hessian[np.ix_(others, others)]
            answer[others] = -np.linalg.pinv(inner, hermitian=True) @ hessian[others, k]
        starts[k] += (grid[k] - centre[k])[:, None] * answer
        starts[k] = np.clip(starts[k], 0.0, 1.0)
        starts[k, :, k] = grid[k]
    return np.asarray(starts.reshape(-1, dimension))


def _minimise(
    problem: Smooth, starts: Array, centre: Array, held: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """End points, values, and which converged; held coordinates stay. Damping after Nielsen (1999)."""
    here = starts.copy()
    value, gradient, hessian = _evaluated(problem, here, held)
    lost = np.isnan(value)
    if lost.any():  # the quadratic model led astray: begin where the others have their best values
        here[lost] = np.where(held[lost], here[lost], centre)
        value[lost], gradient[lost], hessian[lost] = _evaluated(problem, here[lost], held[lost])
    damping, growth = np.full(len(here), _DAMPING), np.full(len(here), 2.0)
    done = np.isnan(value)
    converged = np.zeros(len(here), dtype=bool)
    for _ in range(ITERATIONS):
        gain = box_step(here, gradient, hessian, np.full(len(here), _LEAST), _STRIDE)[1]
        stuck = damping > _MOST
        converged |= ~done & ((gain <= DECREASE) | (stuck & (gain <= STALLED)))
        done |= converged | stuck
        rows = np.flatnonzero(~done)
        if rows.size == 0:
            break
        step, fall = box_step(here[rows], gradient[rows], hessian[rows], damping[rows], _STRIDE)
        trial = np.where(held[rows], here[rows], np.clip(here[rows] + step, 0.0, 1.0))
        new = _evaluated(problem, trial, held[rows])
        ratio = np.where(fall > 0, (value[rows] - new[0]) / np.where(fall > 0, fall, 1.0), -1.0)
        ratio = np.where(np.isnan(ratio), -1.0, ratio)
        good = ratio > _ACCEPT
        shrink = np.maximum(1 / 3, 1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3)
        damping[rows] = np.maximum(damping[rows] * np.where(good, shrink, growth[rows]), _LEAST)
        growth[rows] = np.where(good, 2.0, 2 * growth[rows])
        taken = rows[good]
        here[taken], value[taken] = trial[good], new[0][good]
        gradient[taken], hessian[taken] = new[1][good], new[2][good]
    return here, value, converged


def _evaluated(problem: Smooth, points: Array, held: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Value, gradient and Hessian with the held coordinate cut loose, so that no step moves it; nan value if failed."""
    value, gradient, hessian = problem.evaluate(points)
    usable = np.isfinite(value) & np.isfinite(gradient).all(axis=1) & np.isfinite(hessian).all(axis=(1, 2))
    free = usable[:, None] & ~held
    loose = held[:, :, None] & np.eye(held.shape[1], dtype=bool)
    hessian = np.where(free[:, :, None] & free[:, None, :], hessian, 0.0) + loose
    return np.where(usable, value, np.nan), np.where(free, gradient, 0.0), hessian
