"""Fireflies of the last generation whose signals a page can show."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mofit.identification.result import IdentificationResult
from mofit.identification.result_tree.modes import PREDICTIVE_NUMBERS
from mofit.identification.result_tree.outputs import simulated_signals
from mofit.results import axis, group_dataset, parameter_axis

#: Fireflies with signals of their own.
FIREFLIES = 12


def firefly_groups(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """Fireflies of the last generation, evenly spread from the best to the poorest, and what the model gives there.

    None where the search had no swarm, where records are so long that one of them fills a page, or where simulations
    are dear.
    """
    problem, searched, found = outcome.problem, outcome.searched, outcome.search
    samples = sum(experiment.measured.size for experiment in problem.experiments)
    most = min(FIREFLIES, PREDICTIVE_NUMBERS // samples)
    if outcome.study or not found.generations.size or problem.evaluations is not None or most < 2:
        return {}
    last = np.unique(found.generations[-1])
    last = last[np.isfinite(found.cost[last])]
    ranked = last[np.argsort(found.cost[last], kind="stable")]
    shown = ranked[np.linspace(0, len(ranked) - 1, min(most, len(ranked))).astype(int)]
    space = problem.space
    values = searched.layout.values(found.points[shown], space.names)
    axes = {
        "firefly": axis("firefly", [str(k + 1) for k in range(len(shown))]),
        "objective": axis("objective", list(searched.objective_names)),
        **parameter_axis(space.names, space.units),
    }
    return {
        "/fireflies": group_dataset("/fireflies", {"value": values, "nrmsd": found.objectives[shown]}, axes),
        "/fireflies/prediction": simulated_signals(problem, space.to_unit(values), dtype=np.float32),
    }
