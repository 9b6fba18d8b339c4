"""Local refinement that ends early where the minimum cannot count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.optimize import Minimum, RefineSettings, merge, refine
from mofit.optimize.levenberg_marquardt import Evaluate

#: Iterations after which it is asked which starts may still come down to the limit, and after twice as many again: most
#: are near their end by then.
_FIRST = 8
#: Share of what a start lacks of the limit that a Newton step must promise, and a round gain: with less, hardly
#: anything will change.
_HOPELESS = 0.05


def best_minimum(evaluate: Evaluate, starts: ArrayLike, settings: RefineSettings, limit: float = np.inf) -> Minimum:
    """The best minimum from starts (K, d) of the unit cube.

    ``limit`` is the value that counts: a start far above it ends where a Newton step hardly gains anything.

    Raises
    ------
    InputError
        If no start can be evaluated.
    """
    left, points = settings.max_iterations, np.clip(np.atleast_2d(starts), 0.0, 1.0)
    before, found = np.full(len(points), np.inf), list[Minimum]()
    iterations = min(_FIRST, left) if np.isfinite(limit) else left
    while iterations and len(points):
        refined = refine(evaluate, points, replace(settings, max_iterations=iterations))
        found += merge(refined)
        on = np.array([status == "limit" for status in refined.status])
        on &= _may_win(refined.values, refined.gradients, refined.hessians, limit)
        on &= before - refined.values > _HOPELESS * (refined.values - limit)
        points, before = refined.points[on], refined.values[on]
        left -= iterations
        iterations = min(2 * iterations, left)
    if not found:
        raise InputError.of("diagnosis", "every start failed", "Check the model, or narrow the bounds")
    return min(found, key=lambda one: one.value)


def _may_win(values: FloatArray, gradients: FloatArray, hessians: FloatArray, limit: float) -> NDArray[np.bool_]:
    """Which points lack so little of the limit, or gain so much by a Newton step, that they may come down to it."""
    # scaled, and by a pseudo-inverse: beside derivatives of 1e30 a unit matrix makes none regular
    sizes = np.sqrt(1 + np.diagonal(hessians, axis1=1, axis2=2))
    scaled = (hessians + np.eye(gradients.shape[1])) / (sizes[:, :, None] * sizes[:, None, :])
    slopes = gradients / sizes
    steps = (np.linalg.pinv(scaled, hermitian=True) @ slopes[..., None])[..., 0]
    return np.asarray(0.5 * np.sum(slopes * steps, axis=1) > _HOPELESS * (values - limit))
