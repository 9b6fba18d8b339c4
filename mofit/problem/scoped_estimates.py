"""Estimates of the parameters that have a value per test or condition, with their spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.problem.problem import Problem
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


def scoped_at_bound(problem: Problem, point: FloatArray) -> tuple[str, ...]:
    """Names of the scoped parameters that lie at an end of their range in any test, at a point (d,)."""
    simulator = problem.simulator
    if not isinstance(simulator, ScopedSimulator):
        return ()
    best = simulator.best(problem.layout.full(point[None]))
    unit = best.unknowns.by_test(best.unit)[0]
    held = ((unit <= 0) | (unit >= 1)).any(axis=0)
    return tuple(name for name, one in zip(simulator.scopes.space.names, held, strict=True) if one)


def scoped_estimates(problem: Problem, point: FloatArray, covariance: FloatArray) -> ScopedEstimates | None:
    """Scoped values at a point (d,) with posterior covariance (d, d), both in unit coordinates; None without any."""
    simulator = problem.simulator
    if not isinstance(simulator, ScopedSimulator):
        return None
    p = problem.layout.full(point[None])
    space, best = simulator.scopes.space, simulator.best(p)
    values = best.values[0][:, simulator.columns]
    if problem.pooling is None:
        own = np.diagonal(problem.scoped_covariance(point), axis1=1, axis2=2)
        inner = np.sqrt(best.unknowns.by_test(own[None])[0]) * space.derivative(values)
    else:
        pooled = problem.pooled_at(point).pooling
        assert pooled is not None
        values, inner = (best.unknowns.by_test(one[None])[0] for one in pooled.shrunk(problem.space))
    # D by unit coordinates of the shared parameters
    count = len(simulator.free)
    slopes = simulator.slopes(p)[0] * problem.space.derivative(problem.space.from_unit(point))[:count]
    shared = np.einsum("tlf,fg,tlg->tl", slopes, covariance[:count, :count], slopes)
    unit = best.unknowns.by_test(best.unit)[0]
    tests = problem.tests
    return ScopedEstimates(
        space=space,
        values=values,
        sd=np.sqrt(inner**2 + shared),
        at_bound=(unit >= 1).astype(np.int64) - (unit <= 0),
        labels=tuple(simulator.scopes.labels[test] for test in tests),
    )
