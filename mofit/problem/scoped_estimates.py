"""Estimates of the parameters that have a value per test or condition, with their spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.problem.problem import Problem
from mofit.problem.score_covariance import scatter
from mofit.simulation.scoped_simulator import ScopedSimulator


@dataclass(frozen=True)
class ScopedEstimates:
    """Values of L scoped parameters in T tests; tests with one label share a value."""

    space: ParameterSpace
    values: FloatArray
    """(T, L), in SI units."""
    sd: FloatArray
    """Standard deviation, (T, L): that of the value itself, and what the shared parameters leave open."""
    at_bound: NDArray[np.int64]
    """-1 at the lower, 1 at the upper end of the range, (T, L)."""
    labels: tuple[tuple[str, ...], ...]
    """What each value belongs to: a test or a condition with its value, (T, L)."""


def inner_covariance(problem: Problem, simulator: ScopedSimulator, point: FloatArray) -> FloatArray:
    r"""Covariance :math:`N^{-1} J N^{-1}` of the scoped values of every group at fixed shared ones, (G, m, m).

    In unit coordinates, at a point (d,); J is the covariance of the gradient by noise and gap (`score_covariance`).
    """
    p = problem.layout.full(point[None])
    best = simulator.best(p)
    slope = simulator.scopes.space.derivative(best.values[0][:, simulator.columns])  # (T, L)
    responses = (
        (values[..., 0], values[..., 1:] * own) for values, own in zip(simulator.scoped_slopes(p), slope, strict=True)
    )
    gap = problem.score(point).gap_squares
    parts = scatter(problem.experiments, problem.periods, problem.noise.weights, responses, gap)
    summed = best.unknowns.summed_matrices(simulator.objective_tests, parts[None])[0]
    held = best.held()[0]
    summed[held] = 0.0
    summed.swapaxes(-1, -2)[held] = 0.0
    inverse = np.linalg.inv(best.normal[0])
    return np.asarray(inverse @ summed @ inverse)


def scoped_estimates(problem: Problem, point: FloatArray, covariance: FloatArray) -> ScopedEstimates | None:
    """Scoped values at a point (d,) with posterior covariance (d, d), both in unit coordinates; None without any."""
    simulator = problem.simulator
    if not isinstance(simulator, ScopedSimulator):
        return None
    p = problem.layout.full(point[None])
    space, best = simulator.scopes.space, simulator.best(p)
    own = inner_covariance(problem, simulator, point)
    variance = best.unknowns.by_test(np.diagonal(own, axis1=1, axis2=2)[None])[0]
    values = best.values[0][:, simulator.columns]
    # D by unit coordinates of the shared parameters
    slopes = simulator.slopes(p)[0] * problem.space.derivative(problem.space.from_unit(point))
    shared = np.einsum("tlf,fg,tlg->tl", slopes, covariance, slopes)
    unit = best.unknowns.by_test(best.unit)[0]
    tests = problem.tests
    return ScopedEstimates(
        space=space,
        values=values,
        sd=np.sqrt(variance * space.derivative(values) ** 2 + shared),
        at_bound=(unit >= 1).astype(np.int64) - (unit <= 0),
        labels=tuple(simulator.scopes.labels[test] for test in tests),
    )
