"""The whole tree, group by group."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.metadata import version

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mofit import __version__
from mofit.identification.result import IdentificationResult
from mofit.identification.result_tree.comparison import calibration_groups
from mofit.identification.result_tree.modes import mixture_groups, mode_groups
from mofit.identification.result_tree.signals import constant_data, observed_data
from mofit.optimize import hypervolume_history
from mofit.results import SCHEMA, axis, group_dataset, parameter_axis, quantity
from mofit.runtime.run_directory import configuration_hash

#: The libraries whose versions can change a number.
LIBRARIES = ("numpy", "scipy", "casadi", "llvmlite", "emcee", "xarray", "arviz-stats", "moocore")


def assemble(outcome: IdentificationResult) -> xr.DataTree:
    """The result tree of an identification, with every group that the outcome has something for."""
    groups: dict[str, xr.Dataset] = {
        "/": _root(outcome),
        "/parameters": _parameters(outcome),
        **_fixed(outcome),
        "/search": _search(outcome),
        "/front": _front(outcome),
        "/minima": _minima(outcome),
        "/observed_data": observed_data(outcome.problem),
        "/constant_data": constant_data(outcome.problem),
        **outcome.references,
        **calibration_groups(outcome),
        **mode_groups(outcome),
        **mixture_groups(outcome),
    }
    return xr.DataTree.from_dict(groups)


def _root(outcome: IdentificationResult) -> xr.Dataset:
    problem = outcome.problem
    output = problem.model.outputs[0]
    experiments = [measurement.experiment for measurement in problem.measurements]

    def known(values: list[float | None]) -> list[float]:
        return [np.nan if value is None else value for value in values]

    starts = [
        float(experiment.time[np.argmax(seen.weights[:, 0] > 0)] - experiment.time[0])
        for experiment, seen in zip(experiments, problem.experiments, strict=True)
    ]
    test: dict[str, ArrayLike] = {
        "excitation": [experiment.kind for experiment in experiments],
        "frequency": known([experiment.frequency for experiment in experiments]),
        "amplitude": known([experiment.amplitude for experiment in experiments]),
        "period": known([signal.period for signal in problem.signals]),
        "periods": [signal.periods for signal in problem.signals],
        "transient": starts,
        "noise_sd": [signal.noise_sd[output.name] for signal in problem.signals],
        "noise_floor": [signal.noise_floor[output.name] for signal in problem.signals],
        "range": [float(np.ptp(measurement.channel(output.name))) for measurement in problem.measurements],
        "weight": outcome.weights,
        "gap": problem.noise.gap,
        "effective_samples": problem.noise.independent,
    }
    campaign = outcome.campaign
    model = problem.model
    attributes = {
        "schema": SCHEMA,
        "title": f"{model.title or model.name} on {campaign.title}",
        "mofit_version": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": outcome.configuration["seed"],
        "model": model.name,
        "model_title": model.title or model.name,
        "campaign_title": campaign.title,
        "campaign_source": campaign.source,
        "configuration": json.dumps(outcome.configuration, sort_keys=True),
        "configuration_hash": configuration_hash(outcome.configuration),
        "campaign_hash": campaign.hash(),
        "library_versions": json.dumps({name: version(name) for name in LIBRARIES}),
        "converged": int(outcome.converged),
        "seconds": json.dumps({name: round(value, 3) for name, value in outcome.seconds.items()}),
        "evaluations": json.dumps(_evaluations(outcome)),
        "warnings": json.dumps(list(outcome.warnings)),
    }
    units = {"amplitude": problem.model.inputs[0].unit, "noise_sd": output.unit, "range": output.unit}
    return group_dataset("/", test, {"test": axis("test", list(problem.tests))}, attributes, units=units)


def _evaluations(outcome: IdentificationResult) -> dict[str, int]:
    return {
        "search": outcome.search.evaluations,
        "sample": int(sum(mode.chains.evaluations for mode in outcome.modes)),
    }


def _parameters(outcome: IdentificationResult) -> xr.Dataset:
    space = outcome.problem.space
    calibrated = {name for calibration in outcome.calibrations for name in calibration.problem.space.names}
    roles = ["calibration" if name in calibrated else "dynamic" for name in space.names]
    return group_dataset(
        "/parameters",
        {
            "lower": space.lower,
            "upper": space.upper,
            "nominal": space.nominal,
            "scale": [p.scale for p in space.parameters],
            "role": roles,
            "description": [p.description or p.name for p in space.parameters],
        },
        parameter_axis(space.names, space.units),
    )


def _fixed(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """Parameters that were not identified, each a variable of its own with its value."""
    fixed = outcome.configuration["fixed"]
    variables = {
        p.name: quantity((), fixed[p.name], p.unit, p.description or p.name)
        for p in outcome.problem.model.parameters
        if p.name in fixed
    }
    return {"/fixed": xr.Dataset(variables)} if variables else {}


def _search_values(outcome: IdentificationResult, points: np.ndarray) -> np.ndarray:
    """Searched points as values of all free parameters; those held during the search are constant."""
    full = outcome.searched.layout.full(points)
    columns = [outcome.searched.system.parameters.index(name) for name in outcome.problem.space.names]
    return np.asarray(full[:, columns])


#: Evaluations at which the hypervolume is recorded, as shares of all.
CHECKPOINTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)


def _search(outcome: IdentificationResult) -> xr.Dataset:
    found = outcome.search
    checkpoints = np.unique(np.ceil(np.array(CHECKPOINTS) * found.evaluations).astype(int))
    return group_dataset(
        "/search",
        {
            "hypervolume": hypervolume_history(found.objectives, checkpoints),
            "best": np.minimum.accumulate(found.cost)[checkpoints - 1],
            "points": _search_values(outcome, found.points),
            "nrmsd": found.objectives,
            "archived": _search_values(outcome, found.archived_points),
            "archived_cost": found.archived_cost,
            "population": _search_values(outcome, found.population_points),
        },
        {
            **parameter_axis(outcome.problem.space.names, outcome.problem.space.units),
            "objective": axis("objective", list(outcome.searched.tests)),
            "checkpoint": axis("checkpoint", checkpoints),
        },
        {
            "method": outcome.configuration["search"],
            "evaluations": found.evaluations,
            "gradients": found.gradients,
            "expected_undiscovered_minima": np.nan
            if found.expected_undiscovered is None
            else found.expected_undiscovered,
        },
    )


def _front(outcome: IdentificationResult) -> xr.Dataset:
    found = outcome.search
    return group_dataset(
        "/front",
        {
            "nrmsd": found.objectives[found.front],
            "parameters": _search_values(outcome, found.points[found.front]),
        },
        {
            **parameter_axis(outcome.problem.space.names, outcome.problem.space.units),
            "objective": axis("objective", list(outcome.searched.tests)),
        },
    )


def _minima(outcome: IdentificationResult) -> xr.Dataset:
    """All refined minima, also those without posterior weight."""
    points = np.stack([minimum.point for minimum in outcome.minima])
    problem = outcome.problem
    return group_dataset(
        "/minima",
        {
            "value": problem.space.from_unit(points),
            "nrmsd": problem.objectives(points),
            "log_posterior": [-minimum.value for minimum in outcome.minima],
            "at_bound": np.stack([minimum.at_bound for minimum in outcome.minima]),
        },
        {**parameter_axis(problem.space.names, problem.space.units), "test": axis("test", list(problem.tests))},
    )
