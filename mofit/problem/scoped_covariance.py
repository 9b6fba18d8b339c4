"""Covariance of the scoped values of every group of tests while the shared parameters are held."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.problem.score_covariance import scatter
from mofit.simulation.scoped_simulator import ScopedSimulator


def scoped_covariance(
    simulator: ScopedSimulator,
    p: FloatArray,
    periods: Sequence[float | None],
    weights: FloatArray,
    gap_squares: tuple[float, float],
) -> FloatArray:
    r"""Covariance :math:`N^{-1} J N^{-1}` of the scoped values at one set, (G, m, m), in unit coordinates.

    Parameters
    ----------
    simulator
        Its tests and scopes.
    p
        One set (1, np).
    periods, weights, gap_squares
        As for `mofit.problem.score_covariance.score_covariance`, whose J this is, of the scoped parameters.
    """
    best = simulator.best(p)
    slope = simulator.scopes.space.derivative(best.values[0][:, simulator.columns])  # (T, L)
    responses = (
        (values[..., 0], values[..., 1:] * own) for values, own in zip(simulator.scoped_slopes(p), slope, strict=True)
    )
    parts = scatter(simulator.experiments, periods, weights, responses, gap_squares)
    summed = best.unknowns.summed_matrices(simulator.objective_tests, parts[None])[0]
    held = best.held()[0]
    summed[held] = 0.0
    summed.swapaxes(-1, -2)[held] = 0.0
    inverse = np.linalg.inv(best.normal[0])
    return np.asarray(inverse @ summed @ inverse)
