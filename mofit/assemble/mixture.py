"""The posterior of all solutions together, each with its weight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from mofit.outcome import Outcome
from mofit.result import OWN_UNIT, axis, parameter_axis, quantity
from mofit.sample import mixture


def mixture_groups(outcome: Outcome) -> dict[str, xr.Dataset]:
    """Summary, draws and the solution that each draw belongs to; nothing where there is one solution only."""
    if len(outcome.modes) < 2:
        return {}
    space = outcome.problem.space
    draws = [mode.chains.thinned() for mode in outcome.modes]
    natural = [replace(part, points=space.from_unit(part.points)) for part in draws]
    whole = mixture(natural, [mode.weight for mode in outcome.modes])
    low, median, high = whole.quantiles([0.05, 0.5, 0.95])
    summary = {
        "mean": quantity("parameter", whole.mean(), OWN_UNIT, "mean over all solutions"),
        "sd": quantity("parameter", whole.sd(), OWN_UNIT, "standard deviation over all solutions"),
        "q05": quantity("parameter", low, OWN_UNIT, "5 % quantile over all solutions"),
        "q50": quantity("parameter", median, OWN_UNIT, "median over all solutions"),
        "q95": quantity("parameter", high, OWN_UNIT, "95 % quantile over all solutions"),
    }
    shape = draws[0].points.shape[:2]
    points, belongs = whole.draw(np.random.default_rng(outcome.configuration["seed"]), shape[0] * shape[1])
    axes = {"chain": axis("chain", range(shape[0])), "draw": axis("draw", range(shape[1]))}
    posterior = {
        p.name: quantity(("chain", "draw"), points[:, i].reshape(shape), p.unit, p.description or p.name)
        for i, p in enumerate(space.parameters)
    }
    solution = quantity(("chain", "draw"), belongs.reshape(shape) + 1, "1", "number of the solution: 2 is c2")
    return {
        "/mixture": xr.Dataset(summary, parameter_axis(space.names, space.units)),
        "/mixture/posterior": xr.Dataset(posterior, axes),
        "/mixture/sample_stats": xr.Dataset({"solution": solution}, axes),
    }
