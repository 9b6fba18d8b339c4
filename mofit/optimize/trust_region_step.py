"""One damped Gauss-Newton step inside a box, for many points at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray


def curvature_scale(hessians: FloatArray) -> FloatArray:
    """Diagonal of the Hessian, at least 1, shape (K, d).

    A curvature below 1 means a standard deviation wider than the whole box: there the box is the scale.
    """
    return np.maximum(np.diagonal(hessians, axis1=1, axis2=2), 1.0)


def pressed(points: FloatArray, gradients: FloatArray) -> NDArray[np.int64]:
    """-1 where a point lies on the lower bound and the value falls outwards, 1 on the upper, else 0; shape (K, d)."""
    lower = (points <= 0.0) & (gradients > 0.0)
    upper = (points >= 1.0) & (gradients < 0.0)
    return upper.astype(np.int64) - lower.astype(np.int64)


def scaled_gradient(points: FloatArray, gradients: FloatArray, hessians: FloatArray) -> FloatArray:
    r"""Largest component of the projected gradient in posterior standard deviations, shape (K,).

    .. math:: \max_i |g_i| / \sqrt{\max(H_{ii}, 1)}

    over the coordinates that are not pressed against a bound: how many conditional standard deviations the point is
    away from its minimum along one coordinate.
    """
    free = pressed(points, gradients) == 0
    return np.max(np.where(free, np.abs(gradients), 0.0) / np.sqrt(curvature_scale(hessians)), axis=1)


#: Share of a multiplier's terms, and of a box width, that is rounding.
_ROUNDING = 1e-11
#: Rounds in which all wrong coordinates change sides though they do not become fewer; then one at a time.
_PATIENCE = 3
#: Rounds per coordinate at most: far more than are ever needed but for rounding.
_MOST_ROUNDS = 10


def box_step(
    points: FloatArray, gradients: FloatArray, hessians: FloatArray, damping: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    r"""Approximate minimiser of the damped quadratic model inside the box.

    .. math:: m(s) = g^T s + \tfrac12 s^T (H + \lambda D) s, \quad 0 \le u + s \le 1, \quad |s_i| \le \Delta

    with D = `curvature_scale`. Coordinates pressed against a bound stay there; a component that leaves its limits is
    put on them and the others are solved again, until all fit (at most d rounds). Where many leave them the model may
    even rise: such a step is rejected, and tried again with more damping. `box_minimum` is exact.

    Parameters
    ----------
    points, gradients, hessians
        u (K, d), g (K, d), H (K, d, d), positive semi-definite.
    damping
        lambda > 0, shape (K,).
    reach
        Largest move of one coordinate, Delta.

    Returns
    -------
    The steps (K, d), and by how much the undamped model falls, :math:`-g^T s - s^T H s / 2`, shape (K,).
    """
    dimension = points.shape[1]
    diagonal = np.eye(dimension, dtype=bool)
    damped = hessians + (damping[:, None] * curvature_scale(hessians))[:, :, None] * diagonal
    low, high = np.maximum(-points, -reach), np.minimum(1.0 - points, reach)
    fixed = pressed(points, gradients) != 0
    step = np.zeros_like(points)
    for _ in range(dimension + 1):
        held = np.where(fixed, step, 0.0)
        right = np.where(fixed, held, -gradients - np.einsum("kij,kj->ki", damped, held))
        coupled = ~fixed[:, :, None] & ~fixed[:, None, :]
        step = np.linalg.solve(np.where(coupled, damped, 1.0 * diagonal), right[:, :, None])[:, :, 0]
        outside = ~fixed & ((step < low) | (step > high))
        if not outside.any():
            break
        fixed |= outside
        step = np.clip(step, low, high)
    step = np.clip(step, low, high)
    fall = -np.einsum("ki,ki->k", gradients, step) - 0.5 * np.einsum("ki,kij,kj->k", step, hessians, step)
    return step, fall


def box_minimum(
    points: FloatArray, gradients: FloatArray, hessians: FloatArray, damping: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    r"""Exact minimiser of the damped quadratic model inside the box: what a step may promise.

    .. math:: m(s) = g^T s + \tfrac12 s^T (H + \lambda D) s, \quad 0 \le u + s \le 1, \quad |s_i| \le \Delta

    with D = `curvature_scale`, by block principal pivoting: coordinates beyond a limit are put on it, those that the
    model pulls off their limit are free again, all at once as long as they become fewer.

    Parameters
    ----------
    points, gradients, hessians
        u (K, d), g (K, d), H (K, d, d), positive semi-definite.
    damping
        lambda > 0, shape (K,).
    reach
        Largest move of one coordinate, Delta.

    Returns
    -------
    The steps (K, d), and by how much the undamped model falls, :math:`-g^T s - s^T H s / 2 \ge 0`, shape (K,).

    References
    ----------
    Júdice, Pires: A block principal pivoting algorithm for large-scale strictly monotone linear complementarity
    problems (1994).
    """
    count, dimension = points.shape
    diagonal = np.eye(dimension, dtype=bool)
    # in units in which D is 1: beside derivatives of 1e30 no damping makes a matrix regular
    units = np.sqrt(curvature_scale(hessians))
    scaled, gradient = hessians / (units[:, :, None] * units[:, None, :]), gradients / units
    damped = scaled + damping[:, None, None] * diagonal
    low, high = units * np.maximum(-points, -reach), units * np.minimum(1.0 - points, reach)
    side = pressed(points, gradients)
    fewest, patience = np.full(count, dimension + 1), np.full(count, _PATIENCE)
    step = np.zeros_like(points)
    for _ in range(_MOST_ROUNDS * dimension):
        held = np.select([side < 0, side > 0], [low, high], 0.0)
        right = np.where(side == 0, -gradient - np.einsum("kij,kj->ki", damped, held), held)
        coupled = (side == 0)[:, :, None] & (side == 0)[:, None, :]
        step = np.linalg.solve(np.where(coupled, damped, 1.0 * diagonal), right[:, :, None])[:, :, 0]
        slope = gradient + np.einsum("kij,kj->ki", damped, step)
        allowed = _ROUNDING * (np.abs(gradient) + np.einsum("kij,kj->ki", np.abs(damped), np.abs(step)))
        beyond = np.where(step > high + _ROUNDING * units, 1, 0) - np.where(step < low - _ROUNDING * units, 1, 0)
        wrong = np.where(side == 0, beyond != 0, side * slope > allowed)
        if not wrong.any():
            break
        left = wrong.sum(axis=1)
        patience = np.where(left < fewest, _PATIENCE, patience - 1)
        fewest = np.minimum(left, fewest)
        last = dimension - 1 - np.argmax(wrong[:, ::-1], axis=1)
        wrong &= (patience > 0)[:, None] | (np.arange(dimension) == last[:, None])
        side = np.where(wrong, np.where(side == 0, beyond, 0), side)
    step = np.clip(step, low, high)
    fall = -np.einsum("ki,ki->k", gradient, step) - 0.5 * np.einsum("ki,kij,kj->k", step, scaled, step)
    return step / units, fall
