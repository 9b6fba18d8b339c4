"""Estimates of parameters with a value per test or condition, as a group of a mode."""

from __future__ import annotations

import xarray as xr
from numpy.typing import ArrayLike

from mofit.optimize import Minimum
from mofit.problem import Problem
from mofit.problem.scoped_estimates import scoped_estimates
from mofit.results import axis, group_dataset, parameter_axis
from mofit.sampling import laplace_covariance


def scoped_group(path: str, problem: Problem, minimum: Minimum) -> dict[str, xr.Dataset]:
    """The group of a mode; none where every parameter belongs to the campaign."""
    found = scoped_estimates(problem, minimum.point, laplace_covariance(minimum.hessian))
    if found is None:
        return {}
    space = found.space
    data: dict[str, ArrayLike] = {
        "value": found.values,
        "sd": found.sd,
        "at_bound": found.at_bound,
        "label": [list(own) for own in found.labels],
        "lower": space.lower,
        "upper": space.upper,
        "description": [p.description or p.name for p in space.parameters],
    }
    axes = {"test": axis("test", list(problem.tests)), **parameter_axis(space.names, space.units, "parameter_scoped")}
    return {path: group_dataset(path, data, axes)}
