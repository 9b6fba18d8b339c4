"""Nuisances: values that a test has of its own, such as an angle, an offset or an initial state.

No other test tells them. Where a test is left out of a fit, its nuisances are estimated from the test itself, with all
that the tests share as the others have it: the prediction is of what they share.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hypothesis import Hypothesis, Linear
from mofit.optimize import RefineSettings, minimise_each


def with_own_nuisances(
    model: Hypothesis, points: FloatArray, tests: Sequence[Sequence[int]], settings: RefineSettings
) -> FloatArray:
    """Points (K, d), each with the nuisances of some tests (K of them) at their best for these tests alone."""
    owner, rows = model.layout.only_test, len(model.observed.measured)
    if np.all(owner < 0):
        return points
    used = np.zeros((len(points), rows + len(model.prior_rows[0])), dtype=bool)
    used[:, :rows] = [np.isin(model.observed.test, some) for some in tests]
    own = np.array([np.isin(owner, some) for some in tests])

    def of_test(at: FloatArray, which: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        found = model.linear(at)
        jacobian = found.jacobian * used[which][:, :, None] * own[which][:, None]
        value, gradient, hessian = Linear(np.where(used[which], found.residual, 0.0), jacobian).normal_equations()
        # what is held has a curvature, so that the damping leaves it alone
        return value, gradient, hessian + np.eye(len(owner)) * ~own[which][:, None]

    found = minimise_each(of_test, points.copy(), settings).points
    return np.where(own, found, points)


def beside_nuisances(baseline: Fitted, added: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of the rows by the model's other parameters, the same and the added columns, and the residual.

    All are projected beside the nuisances (Frisch, Waugh, Lovell): least squares without a test then predict it with
    its own nuisances at their best, since these act on a single test each.
    """
    free = baseline.free
    model, residual = -baseline.jacobian[:, free], baseline.residual
    nuisance = baseline.hypothesis.layout.only_test[free] >= 0
    shared = model[:, ~nuisance]
    both = np.concatenate([shared, *added], axis=1)
    if nuisance.any():
        columns = model[:, nuisance]
        basis = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny))[0]
        both, residual = (one - basis @ (basis.T @ one) for one in (both, residual))
    return both[:, : shared.shape[1]], both, residual
