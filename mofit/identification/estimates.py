"""Point estimates of a run that is not finished: what it knows before anything is sampled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mofit.optimize import Minimum
from mofit.problem import AdjustedPosterior, Problem
from mofit.sampling import laplace_covariance


def estimates(problem: Problem, minima: Sequence[tuple[Minimum, AdjustedPosterior]]) -> dict[str, Any]:
    """Plain values of every plausible minimum, the most probable first: estimate, standard deviation, unit, NRMSD."""
    space, modes = problem.space, []
    for minimum, _ in minima:
        values = space.from_unit(minimum.point)
        sd = np.sqrt(np.diag(laplace_covariance(minimum.hessian))) * space.derivative(values)
        nrmsd = problem.objectives(minimum.point[None])[0]
        modes.append(
            {
                "parameters": {
                    one.name: {"value": float(value), "sd": float(own), "unit": one.unit}
                    for one, value, own in zip(space.parameters, values, sd, strict=True)
                },
                "nrmsd": dict(zip(problem.objective_names, map(float, nrmsd), strict=True)),
            }
        )
    return {"schema": "mofit.estimates/1", "spread": "Laplace approximation, not sampled", "modes": modes}
