"""The laws of parameters over conditions: which, how they compare, and the curves with their bands."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.data.join import specimen_name
from mofit.identification.law_study import LawStudy
from mofit.identification.result import IdentificationResult, PosteriorMode
from mofit.models import values_under
from mofit.parameters import Parameter
from mofit.quantities import title_of
from mofit.results import axis, group_dataset, parameter_axis, quantity
from mofit.sampling import laplace_covariance

#: Points of a curve and of each side of a map, and draws of a mode that was not sampled.
POINTS, CELLS, DRAWS = 41, 15, 2000


def law_groups(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """The groups of the laws; none where no parameter was looked at over conditions."""
    study = outcome.study
    if study is None:
        return {}
    known = {one.name: one for one in outcome.problem.model.parameters}
    draws = _draws(outcome)
    return {
        "/laws": _choice(study),
        "/laws/cells": _cells(study, known, draws),
        **_curves(study, known, draws),
        **_maps(study, known, draws),
        **_populations(study, outcome),
    }


def _choice(study: LawStudy) -> xr.Dataset:
    """Every law with the log evidence of what it was chosen from."""
    keys = list(study.fit.forms)
    candidates = list(dict.fromkeys(form for row in study.evidence.values() for form in row))
    evidence = [[study.evidence[key].get(form, np.nan) for form in candidates] for key in keys]
    titles = {(law.parameter, law.condition): law for law in study.laws}
    return group_dataset(
        "/laws",
        {
            "parameter": [name for name, _ in keys],
            "condition": [condition for _, condition in keys],
            "form": [study.fit.forms[key] for key in keys],
            "centre": [titles[key].centre if key in titles else np.nan for key in keys],
            "half_range": [titles[key].half_range if key in titles else np.nan for key in keys],
            "log_evidence": evidence,
        },
        {
            "law": axis("law", [f"{name} over {condition}" for name, condition in keys]),
            "candidate": axis("candidate", candidates),
            "unit": quantity(
                "law", [_unit(study, condition) for _, condition in keys], "1", "SI unit of the condition"
            ),
        },
        {
            "conditions": ",".join(study.cells.conditions),
            "chi_square": study.fit.chi_square,
            "freedom": study.fit.freedom,
            "evaluations": study.evaluations,
        },
    )


def _cells(study: LawStudy, known: Mapping[str, Parameter], draws: Mapping[str, FloatArray]) -> xr.Dataset:
    """Estimates of every combination alone, beside the law there."""
    cells = study.cells
    names = [one.name for one in cells.parameters]
    bands = np.full((3, len(cells.at), len(names)), np.nan)
    for k, name in enumerate(names):
        if name in draws:
            for g, at in enumerate(cells.at):
                bands[:, g, k] = _band(known[name], study, draws, dict(zip(cells.conditions, at, strict=True)))
    found = group_dataset(
        "/laws/cells",
        {
            "value": cells.values,
            "sd": cells.sd,
            "law_low": bands[0],
            "law_median": bands[1],
            "law_high": bands[2],
            "tests": [", ".join(tests) for tests in study.tests],
        },
        {
            "cell": axis("cell", np.arange(1, len(cells.at) + 1)),
            **parameter_axis(names, [one.unit for one in cells.parameters]),
        },
    )
    for k, (name, unit) in enumerate(zip(cells.conditions, cells.units, strict=True)):
        found[name] = quantity("cell", cells.at[:, k], unit, title_of(name))
    return found


def _curves(study: LawStudy, known: Mapping[str, Parameter], draws: Mapping[str, FloatArray]) -> dict[str, xr.Dataset]:
    """Of every law the curve over the range of its condition, the other conditions in the middle of theirs."""
    found = {}
    middle = {law.condition: law.centre for law in study.laws}
    for law in study.laws:
        parameter, path = known[law.parameter], f"/laws/curves/{law.parameter}/{law.condition}"
        over = np.linspace(law.centre - law.half_range, law.centre + law.half_range, POINTS)
        bands = np.array([_band(parameter, study, draws, {**middle, law.condition: value}) for value in over]).T
        unit = parameter.unit
        values = {"at": over, "low": bands[0], "median": bands[1], "high": bands[2]}
        units = {"at": law.unit, "low": unit, "median": unit, "high": unit}
        names = {"at": title_of(law.condition)}
        found[path] = group_dataset(path, values, {}, {"title": law.title}, units=units, long_names=names)
    return found


def _maps(study: LawStudy, known: Mapping[str, Parameter], draws: Mapping[str, FloatArray]) -> dict[str, xr.Dataset]:
    """Of every parameter with laws over two conditions or more, its map over the first two."""
    found = {}
    middle = {law.condition: law.centre for law in study.laws}
    for name in dict.fromkeys(law.parameter for law in study.laws):
        laws = [law for law in study.laws if law.parameter == name]
        if len(laws) < 2:
            continue
        first, second = (np.linspace(q.centre - q.half_range, q.centre + q.half_range, CELLS) for q in laws[:2])
        bands = np.array(
            [
                [
                    _band(known[name], study, draws, {**middle, laws[0].condition: x, laws[1].condition: y})
                    for x in first
                ]
                for y in second
            ]
        )
        unit, path = known[name].unit, f"/laws/maps/{name}"
        found[path] = group_dataset(
            path,
            {"x": first, "y": second, "low": bands[..., 0], "median": bands[..., 1], "high": bands[..., 2]},
            {},
            {"x": laws[0].condition, "y": laws[1].condition},
            units={"x": laws[0].unit, "y": laws[1].unit, **dict.fromkeys(("low", "median", "high"), unit)},
            long_names={"x": title_of(laws[0].condition), "y": title_of(laws[1].condition)},
        )
    return found


def _populations(study: LawStudy, outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """Mean and spread of every parameter over specimens, and the specimens that stand out."""
    if not study.populations:
        return {}
    known = {one.name: one for one in study.cells.parameters}
    rows = study.populations
    names = [specimen_name(outcome.campaign, float(at[0])) for at in study.cells.at]
    found = group_dataset(
        "/laws/populations",
        {
            "mean": [one.mean for one in rows],
            "mean_low": [one.mean_band[0] for one in rows],
            "mean_high": [one.mean_band[1] for one in rows],
            "spread": [one.spread for one in rows],
            "spread_low": [one.spread_band[0] for one in rows],
            "spread_high": [one.spread_band[1] for one in rows],
            "of_logarithm": np.array([known[one.parameter].scale == "log" for one in rows], dtype=np.int8),
        },
        parameter_axis([one.parameter for one in rows], [known[one.parameter].unit for one in rows]),
        {
            "specimens": json.dumps(names),
            "outliers": json.dumps([{**asdict(one), "specimen": names[one.specimen]} for one in study.outliers]),
        },
    )
    return {"/laws/populations": found}


def _band(
    parameter: Parameter, study: LawStudy, draws: Mapping[str, FloatArray], conditions: Mapping[str, float]
) -> FloatArray:
    """5 %, 50 % and 95 % quantile of a parameter under conditions."""
    values = values_under(parameter, study.laws, draws, conditions)
    return np.asarray(np.quantile(values, [0.05, 0.5, 0.95]))


def _draws(outcome: IdentificationResult) -> dict[str, FloatArray]:
    """Draws of the best mode by parameter, and the values of those that were fixed."""
    mode, space = outcome.modes[0], outcome.problem.space
    points = mode.chains.thinned().points.reshape(-1, len(space)) if mode.is_sampled else _normal(mode, outcome)
    values = space.from_unit(points)
    fixed = {name: np.full(len(values), float(value)) for name, value in outcome.configuration["fixed"].items()}
    return {**fixed, **dict(zip(space.names, values.T, strict=True))}


def _normal(mode: PosteriorMode, outcome: IdentificationResult) -> FloatArray:
    """Draws of the Laplace approximation within the box."""
    rng = np.random.default_rng(outcome.configuration["seed"])
    drawn = rng.multivariate_normal(mode.minimum.point, laplace_covariance(mode.minimum.hessian), DRAWS)
    return np.clip(drawn, 0.0, 1.0)


def _unit(study: LawStudy, condition: str) -> str:
    return study.cells.units[study.cells.conditions.index(condition)]
