"""The refinement of a problem, from what a search found to its minima."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mofit.errors import InputError
from mofit.joint import JointProblem
from mofit.problem import Problem
from mofit.refine import Minimum, merge, refine
from mofit.search import SearchResult

Array = NDArray[np.float64]
P = TypeVar("P", bound=Problem | JointProblem)


def starts_of(found: SearchResult) -> Array:
    """What the search stored, and its best point of each test alone."""
    rows = [*found.stored, *np.nanargmin(found.objectives, axis=0)]
    return found.points[list(dict.fromkeys(int(row) for row in rows))]


def refined(problem: P, starts: Array) -> tuple[P, tuple[Minimum, ...]]:
    """Refine, count the independent residuals at the best minimum, and refine again under that noise."""
    first = merge(refine(problem.evaluate, starts))
    if not first:
        raise InputError.of("refinement", "every start failed", "Check the model, or narrow the bounds")
    counted: P = problem.with_noise_at(first[0].point)  # type: ignore[assignment]  # each returns its own kind
    again = refine(counted.evaluate, np.stack([minimum.point for minimum in first]))
    return counted, merge(again, values=lambda u: -counted.log_posterior(u))
