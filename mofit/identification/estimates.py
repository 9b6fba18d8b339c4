"""Point estimates of a run that is not finished: what it knows before anything is sampled, or refined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.optimize import Minimum
from mofit.problem import AdjustedPosterior, Problem
from mofit.sampling import laplace_covariance

SCHEMA = "mofit.estimates/1"


def estimates(problem: Problem, minima: Sequence[tuple[Minimum, AdjustedPosterior]]) -> dict[str, Any]:
    """Plain values of every plausible minimum, the most probable first: estimate, standard deviation, unit, NRMSD."""
    space, modes = problem.space, []
    for minimum, _ in minima:
        deviations = np.sqrt(np.diag(laplace_covariance(minimum.hessian)))
        modes.append(_mode(problem, minimum.point, deviations * space.derivative(space.from_unit(minimum.point))))
    return {"schema": SCHEMA, "spread": "Laplace approximation, not sampled", "modes": modes}


def unrefined(problem: Problem, points: FloatArray) -> dict[str, Any]:
    """The same of points (k, d) of a search, the best first, whose standard deviations are not known yet."""
    order = np.argsort(np.mean(problem.objectives(points) ** 2, axis=1), kind="stable")
    return {"schema": SCHEMA, "spread": "not known, not refined", "modes": [_mode(problem, points[k]) for k in order]}


def _mode(problem: Problem, point: FloatArray, sd: FloatArray | None = None) -> dict[str, Any]:
    space, nrmsd = problem.space, problem.objectives(point[None])[0]
    spread = [None] * len(space) if sd is None else map(float, sd)
    return {
        "parameters": {
            one.name: {"value": float(value), "sd": own, "unit": one.unit}
            for one, value, own in zip(space.parameters, space.from_unit(point), spread, strict=True)
        },
        "nrmsd": dict(zip(problem.objective_names, map(float, nrmsd), strict=True)),
    }
