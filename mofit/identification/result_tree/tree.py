"""The whole tree, group by group."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mofit import __version__
from mofit._typing import FloatArray
from mofit.identification.result import IdentificationResult
from mofit.identification.result_tree.comparison import calibration_groups
from mofit.identification.result_tree.fireflies import firefly_groups
from mofit.identification.result_tree.laws import law_groups
from mofit.identification.result_tree.modes import mixture_groups, mode_groups
from mofit.identification.result_tree.outputs import measured_signals, noise_and_range, over_tests, test_axes, unit_of
from mofit.identification.search_registry import search_descriptions
from mofit.optimize import hypervolume_history
from mofit.problem import Problem
from mofit.quantities import title_of
from mofit.results import SCHEMA, Signal, axis, group_dataset, is_large, parameter_axis, quantity, signal_dataset
from mofit.runtime.files import loaded
from mofit.runtime.memory import give_back
from mofit.runtime.run_directory import configuration_hash
from mofit.simulation.table_cache import drop_tables

#: Evaluations at which the hypervolume is recorded, as shares of all.
CHECKPOINTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
#: The libraries whose versions can change a number.
LIBRARIES = ("numpy", "scipy", "casadi", "llvmlite", "emcee", "xarray", "arviz-stats", "moocore")


def assemble(outcome: IdentificationResult) -> xr.DataTree:
    """The result tree of an identification, with every group that the outcome has something for.

    What is simulated in a large one is computed when it is read: test by test as it is written, and not kept.
    """
    groups: dict[str, xr.Dataset] = {
        "/": _root(outcome),
        "/parameters": _parameters(outcome),
        **_fixed(outcome),
        **_conditions(outcome.problem),
        **({} if outcome.study else _search(outcome)),
        **firefly_groups(outcome),
        **law_groups(outcome),
        "/minima": _minima(outcome),
        "/observed_data": measured_signals(outcome.problem),
        "/constant_data": _constant_data(outcome.problem),
        **outcome.references,
        **calibration_groups(outcome),
        **mode_groups(outcome),
        **mixture_groups(outcome),
    }
    tree = xr.DataTree.from_dict(groups)
    if not is_large(tree):
        return loaded(tree)
    # room for what is computed later
    drop_tables()
    give_back()
    return tree


def _root(outcome: IdentificationResult) -> xr.Dataset:
    problem = outcome.problem
    outputs = problem.model.outputs
    experiments = [measurement.experiment for measurement in problem.measurements]

    def known(values: list[float | None]) -> list[float]:
        return [np.nan if value is None else value for value in values]

    starts = [
        float(experiment.time[np.argmax(np.any(seen.weights > 0, axis=1))] - experiment.time[0])
        for experiment, seen in zip(experiments, problem.experiments, strict=True)
    ]
    test: dict[str, ArrayLike] = {
        "excitation": [experiment.kind for experiment in experiments],
        "frequency": known([experiment.frequency for experiment in experiments]),
        "amplitude": known([experiment.amplitude for experiment in experiments]),
        "period": known([signal.period for signal in problem.signals]),
        "periods": [signal.periods for signal in problem.signals],
        "transient": starts,
        **noise_and_range(problem),
        "weight": over_tests(problem, outcome.weights),
        "gap": problem.noise.gap,
        "effective_samples": over_tests(problem, problem.noise.independent),
    }
    campaign, model = outcome.campaign, problem.model
    evaluations = {
        "search": outcome.study.evaluations if outcome.study else outcome.search.evaluations,
        "sample": int(sum(mode.chains.evaluations for mode in outcome.modes)),
    }
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
        "evaluations": json.dumps(evaluations),
        "warnings": json.dumps(list(outcome.warnings)),
        "findings": json.dumps([asdict(finding) for finding in outcome.findings]),
        "sampled": int(all(mode.is_sampled for mode in outcome.modes)),
    }
    units = {"amplitude": problem.model.inputs[0].unit, "noise_sd": unit_of(outputs), "range": unit_of(outputs)}
    return group_dataset("/", test, test_axes(problem), attributes, units=units)


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


def _conditions(problem: Problem) -> dict[str, xr.Dataset]:
    """Conditions of the model in every test, as the simulation saw them."""
    declared = problem.model.conditions
    if not declared:
        return {}
    values = np.stack([experiment.conditions for experiment in problem.experiments])
    axes = {
        "test": axis("test", list(problem.tests)),
        "condition": axis("condition", [c.name for c in declared]),
        "unit": quantity("condition", [c.unit for c in declared], "1", "SI unit of the condition"),
    }
    return {"/conditions": group_dataset("/conditions", {"value": values}, axes)}


def _constant_data(problem: Problem) -> xr.Dataset:
    """Inputs as the simulation saw them, and where samples count."""
    signals = {}
    for measurement, experiment in zip(problem.measurements, problem.experiments, strict=True):
        name, time = measurement.name, measurement.time
        for values, channel in zip(experiment.inputs[experiment.lead :].T, problem.model.inputs, strict=True):
            title = title_of(channel.name, channel.description)
            signals[f"{name}_{channel.name}"] = Signal(name, time, values, channel.unit, title)
        used = np.any(experiment.weights > 0, axis=1).astype(np.int8)
        signals[f"{name}_weight"] = Signal(name, time, used, "1", "1 where it is used")
    return signal_dataset(signals)


def _search(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """What the search evaluated, and its Pareto front."""
    found, searched, space = outcome.search, outcome.searched, outcome.problem.space

    def values(points: FloatArray) -> FloatArray:
        """Of all free parameters; those that were fixed during the search are constant."""
        return searched.layout.values(points, space.names)

    checkpoints = np.unique(np.ceil(np.array(CHECKPOINTS) * found.evaluations).astype(int))
    axes = {**parameter_axis(space.names, space.units), "objective": axis("objective", list(searched.objective_names))}
    history: dict[str, ArrayLike] = {
        "hypervolume": hypervolume_history(found.objectives, checkpoints),
        "best": np.minimum.accumulate(found.cost)[checkpoints - 1],
        "points": values(found.points),
        "nrmsd": found.objectives,
        "archived": values(found.archived_points),
        "archived_cost": found.archived_cost,
        "population": values(found.population_points),
    }
    if found.found_by:
        history["found_by"] = list(found.found_by)
    if found.minimises:
        history["minimises"] = ["" if k < 0 else searched.objective_names[k] for k in found.minimises]
    if found.generations.size:
        flown = values(found.points[found.generations.ravel()])
        history["generations"] = flown.reshape(*found.generations.shape, -1)
        history["cluster"] = found.generation_labels
    front = {"nrmsd": found.objectives[found.front], "parameters": values(found.points[found.front])}
    undiscovered = found.expected_undiscovered
    attributes = {
        "method": outcome.configuration["search"],
        "description": search_descriptions()[outcome.configuration["search"]],
        "evaluations": found.evaluations,
        "gradients": found.gradients,
        "expected_undiscovered_minima": np.nan if undiscovered is None else undiscovered,
        "complete": -1 if found.complete is None else int(found.complete),
    }
    return {
        "/search": group_dataset(
            "/search", history, {**axes, "checkpoint": axis("checkpoint", checkpoints)}, attributes
        ),
        "/front": group_dataset("/front", front, axes),
    }


def _minima(outcome: IdentificationResult) -> xr.Dataset:
    """All refined minima, also those without posterior weight."""
    points = np.stack([minimum.point for minimum in outcome.minima])
    problem = outcome.problem
    return group_dataset(
        "/minima",
        {
            "value": problem.space.from_unit(points),
            "nrmsd": over_tests(problem, problem.objectives(points)),
            "log_posterior": [-minimum.value for minimum in outcome.minima],
            "at_bound": np.stack([minimum.at_bound for minimum in outcome.minima]),
            "found_by": [minimum.found_by for minimum in outcome.minima],
        },
        {**parameter_axis(problem.space.names, problem.space.units), **test_axes(problem)},
    )
