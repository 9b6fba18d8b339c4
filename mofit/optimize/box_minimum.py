"""The exact minimum of a damped Gauss-Newton model inside a box, for many points at once."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.optimize.trust_region_step import curvature_scale, pressed

#: Share of a multiplier's terms, and of a box width, that is rounding.
_ROUNDING = 1e-11
#: Rounds in which all wrong coordinates change sides though they do not become fewer; then one at a time.
_PATIENCE = 3
#: Rounds per coordinate at most: far more than are ever needed but for rounding.
_MOST_ROUNDS = 10


def box_minimum(
    points: FloatArray, gradients: FloatArray, hessians: FloatArray, damping: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Exact minimiser of the damped quadratic model inside the box: what a step may promise.

    The model, its arguments and results are those of `mofit.optimize.trust_region_step.box_step`; the fall is never
    negative. By block principal pivoting: coordinates beyond a limit are put on it, those that the model pulls off
    their limit are free again, all at once as long as they become fewer.

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
