"""The whole tree, group by group."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.metadata import version

import numpy as np
import xarray as xr

from mofit import __version__
from mofit.assemble.clusters import cluster_groups
from mofit.assemble.comparison import calibration_groups
from mofit.assemble.mixture import mixture_groups
from mofit.assemble.signals import constant_data, observed_data
from mofit.outcome import Outcome
from mofit.result import OWN_UNIT, SCHEMA, axis, parameter_axis, quantity
from mofit.run import configuration_hash
from mofit.search import hypervolume_history

#: The libraries whose versions can change a number.
LIBRARIES = ("numpy", "scipy", "casadi", "llvmlite", "emcee", "xarray", "arviz-stats", "moocore")


def assemble(outcome: Outcome) -> xr.DataTree:
    """The result tree of an identification, with every group that the outcome has something for."""
    groups: dict[str, xr.Dataset] = {
        "/": _root(outcome),
        "/parameters": _parameters(outcome),
        **_held(outcome),
        "/search": _search(outcome),
        "/front": _front(outcome),
        "/minima": _minima(outcome),
        "/observed_data": observed_data(outcome.problem),
        "/constant_data": constant_data(outcome.problem),
        **outcome.compared,
        **calibration_groups(outcome),
        **cluster_groups(outcome),
        **mixture_groups(outcome),
    }
    return xr.DataTree.from_dict(groups)


def _root(outcome: Outcome) -> xr.Dataset:
    problem = outcome.problem
    output = problem.model.outputs[0]
    records, procedures = problem.records, [m.procedure for m in problem.measurements]
    used = [drive.weights[:, 0] > 0 for drive in problem.drives]
    spread = [float(np.ptp(m.channel(output.name))) for m in problem.measurements]

    def known(values: list[float | None]) -> list[float]:
        return [np.nan if value is None else value for value in values]

    test = {
        "kind": quantity("test", [p.kind for p in procedures], "1", "kind of procedure"),
        "frequency": quantity("test", known([p.frequency for p in procedures]), "Hz", "frequency on the label"),
        "amplitude": quantity(
            "test", known([p.amplitude for p in procedures]), problem.model.inputs[0].unit, "amplitude on the label"
        ),
        "period": quantity("test", known([r.period for r in records]), "s", "period found in the data"),
        "periods": quantity("test", [r.periods for r in records], "1", "whole periods"),
        "transient": quantity(
            "test",
            [float(p.time[np.argmax(mask)] - p.time[0]) for p, mask in zip(procedures, used, strict=True)],
            "s",
            "time dropped at the start",
        ),
        "noise_sd": quantity("test", [r.noise_sd[output.name] for r in records], output.unit, "noise of the output"),
        "noise_floor": quantity("test", [r.noise_floor[output.name] for r in records], "1", "NRMSD of the noise alone"),
        "range": quantity("test", spread, output.unit, "peak-to-peak of the output"),
        "weight": quantity("test", outcome.weights, "1", "weight in the search"),
        "gap": quantity((), outcome.problem.noise.gap, "1", "NRMSD that the model misses, common to all tests"),
        "independent": quantity("test", problem.noise.independent, "1", "independent residuals"),
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
    return xr.Dataset(test, {"test": axis("test", list(problem.tests))}, attributes)


def _evaluations(outcome: Outcome) -> dict[str, int]:
    return {
        "search": outcome.search.evaluations,
        "sample": int(sum(mode.chains.evaluations for mode in outcome.modes)),
    }


def _parameters(outcome: Outcome) -> xr.Dataset:
    space = outcome.problem.space
    calibrated = {name for calibration in outcome.calibrations for name in calibration.problem.space.names}
    return xr.Dataset(
        {
            "lower": quantity("parameter", space.lower, OWN_UNIT, "lower bound"),
            "upper": quantity("parameter", space.upper, OWN_UNIT, "upper bound"),
            "nominal": quantity("parameter", space.nominal, OWN_UNIT, "nominal value"),
            "scale": quantity("parameter", [p.scale for p in space.parameters], "1", "scale that is searched"),
            "role": quantity(
                "parameter",
                ["calibration" if name in calibrated else "dynamic" for name in space.names],
                "1",
                "stage that identifies it first",
            ),
            "description": quantity("parameter", [p.description or p.name for p in space.parameters], "1", "meaning"),
        },
        parameter_axis(space.names, space.units),
    )


def _held(outcome: Outcome) -> dict[str, xr.Dataset]:
    """Parameters that were not identified, each a variable of its own with the value it was held at."""
    held = outcome.configuration["fixed"]
    variables = {
        p.name: quantity((), held[p.name], p.unit, p.description or p.name)
        for p in outcome.problem.model.parameters
        if p.name in held
    }
    return {"/held": xr.Dataset(variables)} if variables else {}


def _search_values(outcome: Outcome, points: np.ndarray) -> np.ndarray:
    """Searched points as values of all free parameters; those held during the search are constant."""
    full = outcome.dynamic.full(points)
    columns = [outcome.dynamic.system.parameters.index(name) for name in outcome.problem.space.names]
    return np.asarray(full[:, columns])


#: Evaluations at which the hypervolume is recorded, as shares of all.
CHECKPOINTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)


def _search(outcome: Outcome) -> xr.Dataset:
    found = outcome.search
    checkpoints = np.unique(np.ceil(np.array(CHECKPOINTS) * found.evaluations).astype(int))
    return xr.Dataset(
        {
            "hypervolume": quantity(
                "checkpoint",
                hypervolume_history(found.objectives, checkpoints),
                "1",
                "share of the box between the best and the median of every objective that is dominated",
            ),
            "best": quantity(
                "checkpoint", np.minimum.accumulate(found.cost)[checkpoints - 1], "1", "least weighted mean NRMSD"
            ),
            "points": quantity(
                ("evaluation", "parameter"), _search_values(outcome, found.points), OWN_UNIT, "evaluated points"
            ),
            "nrmsd": quantity(("evaluation", "objective"), found.objectives, "1", "NRMSD per test"),
            "stored": quantity(
                ("stored", "parameter"), _search_values(outcome, found.stored_points), OWN_UNIT, "stored cluster bests"
            ),
            "stored_cost": quantity("stored", found.stored_cost, "1", "weighted mean NRMSD"),
            "fireflies": quantity(
                ("firefly", "parameter"), _search_values(outcome, found.fireflies), OWN_UNIT, "final swarm"
            ),
        },
        {
            **parameter_axis(outcome.problem.space.names, outcome.problem.space.units),
            "objective": axis("objective", list(outcome.dynamic.tests)),
            "checkpoint": axis("checkpoint", checkpoints),
        },
        {
            "method": outcome.configuration["search"],
            "evaluations": found.evaluations,
            "gradients": found.gradients,
            "unseen": np.nan if found.unseen is None else found.unseen,
        },
    )


def _front(outcome: Outcome) -> xr.Dataset:
    found = outcome.search
    return xr.Dataset(
        {
            "nrmsd": quantity(("point", "objective"), found.objectives[found.front], "1", "NRMSD per test"),
            "parameters": quantity(
                ("point", "parameter"),
                _search_values(outcome, found.points[found.front]),
                OWN_UNIT,
                "non-dominated points",
            ),
        },
        {
            **parameter_axis(outcome.problem.space.names, outcome.problem.space.units),
            "objective": axis("objective", list(outcome.dynamic.tests)),
        },
    )


def _minima(outcome: Outcome) -> xr.Dataset:
    """All refined minima, also those without posterior weight."""
    points = np.stack([minimum.point for minimum in outcome.minima])
    problem = outcome.problem
    return xr.Dataset(
        {
            "value": quantity(("minimum", "parameter"), problem.space.from_unit(points), OWN_UNIT, "refined minimum"),
            "nrmsd": quantity(("minimum", "test"), problem.objectives(points), "1", "NRMSD per test"),
            "log_posterior": quantity("minimum", [-m.value for m in outcome.minima], "1", "log posterior density"),
            "at_bound": quantity(
                ("minimum", "parameter"), np.stack([m.at_bound for m in outcome.minima]), "1", "-1 lower, 1 upper bound"
            ),
        },
        {**parameter_axis(problem.space.names, problem.space.units), "test": axis("test", list(problem.tests))},
    )
