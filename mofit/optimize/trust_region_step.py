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


def box_step(
    points: FloatArray, gradients: FloatArray, hessians: FloatArray, damping: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    r"""Approximate minimiser of the damped quadratic model inside the box.

    .. math:: m(s) = g^T s + \tfrac12 s^T (H + \lambda D) s, \quad 0 \le u + s \le 1, \quad |s_i| \le \Delta

    with D = `curvature_scale`. Coordinates pressed against a bound stay there; a component that leaves its limits is
    put on them and the others are solved again, until all fit (at most d rounds). Where many leave them the model may
    even rise: such a step is rejected, and tried again with more damping. `mofit.optimize.box_minimum` is exact.

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
