"""A result read as plain values: its parameters as a layout, its numbers as one JSON object."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mofit.parameters import Parameter, ParameterLayout, ParameterSpace
from mofit.results.laws import laws_summary
from mofit.results.objective_values import objectives, per_objective
from mofit.results.predictions import parts_of_band, prediction_rows
from mofit.results.simulation_counts import simulations


def parameter_layout(tree: xr.DataTree) -> ParameterLayout:
    """The free parameters of a ``mofit.result/2`` tree with their unit cube, then those that were fixed."""
    table = tree["parameters"].dataset
    texts = ("parameter", "unit", "scale", "description")
    columns = [[str(text) for text in table[name].values] for name in texts]
    bounds = np.stack([table[name].values for name in ("lower", "upper", "nominal")], axis=1)
    space = ParameterSpace(
        tuple(
            Parameter(name, unit, low, high, nominal, "log" if scale == "log" else "linear", description)
            for name, unit, scale, description, (low, high, nominal) in zip(*columns, bounds.tolist(), strict=True)
        )
    )
    fixed = fixed_values(tree)
    return ParameterLayout((*space.names, *fixed), space, fixed)


def green(tree: xr.DataTree) -> bool:
    """Whether nothing speaks against the numbers: sampled to the end, every parameter identified, nothing found."""
    best = tree["modes/m1"].dataset
    verdicts = {str(verdict) for verdict in best["verdict"].values} if "verdict" in best else set()
    return bool(tree.attrs["converged"]) and not findings(tree) and verdicts == {"identified"}


def fixed_values(tree: xr.DataTree) -> dict[str, float]:
    """Parameters that the run did not identify, with the values it fixed them at (``--fix``)."""
    return {name: float(value) for name, value in json.loads(tree.attrs["configuration"]).get("fixed", {}).items()}


def summary(tree: xr.DataTree, run: Path) -> dict[str, Any]:
    """The numbers of a ``mofit.result/2`` tree as ``mofit identify --json`` prints them; not finite is None.

    `run` is the folder of the run.
    """
    seconds = json.loads(tree.attrs["seconds"])
    units = tree["parameters"].dataset["unit"]
    return {
        "schema": "mofit.identify/2",
        "run": str(run),
        "converged": bool(tree.attrs["converged"]),
        "trusted": trusted(tree),
        "green": green(tree),
        "findings": findings(tree),
        "seconds": {"total": round(sum(seconds.values()), 3), **seconds},
        "evaluations": json.loads(tree.attrs["evaluations"]),
        "search": _search(tree),
        "simulations": simulations(tree),
        "noise_floor": _by_objective(tree, tree.dataset["noise_floor"]),
        "baseline": _baseline(tree),
        "modes": [_mode(tree, name, node, units) for name, node in tree["modes"].children.items()],
        "laws": laws_summary(tree),
        "per_frequency": _per_frequency(tree),
        "held_out": _held_out(tree),
        "warnings": [*(entry["text"] for entry in findings(tree)), *json.loads(tree.attrs["warnings"])],
    }


def findings(tree: xr.DataTree) -> list[dict[str, str]]:
    """What a reader must know before the numbers: ``kind``, ``level`` and ``text`` each."""
    return list(json.loads(tree.attrs.get("findings", "[]")))


def trusted(tree: xr.DataTree) -> bool:
    """Whether the numbers may be used: everything was sampled to the end, and no limit decided them."""
    return bool(tree.attrs["converged"]) and all(entry["level"] != "untrusted" for entry in findings(tree))


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _by_label(values: xr.DataArray) -> dict[str, float | None]:
    """Numbers over one dimension by its labels."""
    (dim,) = values.dims
    return {str(label): _number(value) for label, value in zip(values[dim].values, values.values, strict=True)}


def _by_objective(tree: xr.DataTree, values: xr.DataArray) -> dict[str, float | None]:
    """Numbers over tests (and outputs) by the names of the objectives."""
    names = (one.name for one in objectives(tree))
    return {name: _number(value) for name, value in zip(names, per_objective(tree, values), strict=True)}


def _search(tree: xr.DataTree) -> dict[str, Any] | None:
    """How the search went: its minima by the stage that found them, and whether it was complete."""
    if "search" not in tree.children:
        return None
    node = tree["search"].dataset
    stages = [str(stage) for stage in node["found_by"].values] if "found_by" in node else []
    complete = int(node.attrs.get("complete", -1))
    return {
        "method": node.attrs["method"],
        "evaluations": int(node.attrs["evaluations"]),
        "minima": node.sizes.get("archive", 0),
        "found_by": {stage: stages.count(stage) for stage in dict.fromkeys(stages)},
        "expected_undiscovered": _number(node.attrs.get("expected_undiscovered_minima", math.nan)),
        "complete": None if complete < 0 else bool(complete),
    }


def _baseline(tree: xr.DataTree) -> dict[str, Any] | None:
    if "baseline" not in tree.children:
        return None
    node = tree["baseline"]
    return {"model": node.attrs["model"], "nrmsd": _by_objective(tree, node.dataset["nrmsd"])}


def _mode(tree: xr.DataTree, name: str, node: xr.DataTree, units: xr.DataArray) -> dict[str, Any]:
    found = node.to_dataset(inherit=False)
    entries = {}
    for parameter in found["parameter"].values:
        at = found.sel(parameter=parameter)
        entries[str(parameter)] = {
            **{key: _number(at[key]) if key in at else None for key in ("value", "mean", "sd", "q05", "q50", "q95")},
            **({} if "sd" in at else {"sd": _number(at["laplace_sd"])}),
            "spread": "sampled" if "sd" in at else "Laplace",
            "unit": str(units.sel(parameter=parameter).item()),
            "verdict": str(at["verdict"].item()) if "verdict" in at else "not sampled",
            "at_bound": int(at["at_bound"]) if "at_bound" in at else 0,
        }
    return {
        "id": name,
        "probability": _number(node.attrs["probability"]),
        "log_evidence": _number(node.attrs["log_evidence"]),
        "found_by": node.attrs.get("found_by", ""),
        "nrmsd": _by_objective(tree, node.dataset["nrmsd"]),
        "parameters": entries,
        **scoped_values(node),
    }


def scoped_values(mode: xr.DataTree) -> dict[str, Any]:
    """Estimates of the parameters of a mode that have a value per test or condition, by what each value belongs to."""
    if "scoped" not in mode.children:
        return {}
    found = mode["scoped"].dataset
    units = found["value"].coords.get("unit", found.get("unit"))
    entries: dict[str, Any] = {}
    for name in map(str, found["parameter_scoped"].values):
        own = found.sel(parameter_scoped=name)
        cells = zip(*(own[key].values for key in ("label", "value", "sd", "at_bound")), strict=True)
        values = {
            str(label): {"value": _number(value), "sd": _number(sd), "at_bound": int(side)}
            for label, value, sd, side in cells
        }
        unit = "" if units is None else str(units.sel(parameter_scoped=name).item())
        entries[name] = {"unit": unit, "values": values}
    return {"scoped": entries}


def _per_frequency(tree: xr.DataTree) -> list[dict[str, Any]]:
    """One entry per test and minimum, as in the paper's Table 4; with several outputs an NRMSD of each."""
    if "per_frequency" not in tree.children:
        return []
    node = tree["per_frequency"].dataset
    return [
        {"test": str(test), "nrmsd": _of_outputs(at["nrmsd"]), "parameters": _by_label(at["value"])}
        for test in node["test"].values
        for minimum in range(node.sizes["minimum"])
        if np.isfinite((at := node.sel(test=test).isel(minimum=minimum))["nrmsd"]).any()
    ]


def _held_out(tree: xr.DataTree) -> dict[str, Any] | None:
    """How the tests that were held out are predicted, beside those that were fitted; None without any."""
    if "held_out" not in tree.children:
        return None
    node = tree.children["held_out"]
    return {**parts_of_band(node), "tests": prediction_rows(node)}


def _of_outputs(nrmsd: xr.DataArray) -> float | dict[str, float | None]:
    """That of the one output, or of each that the test has."""
    return _by_label(nrmsd.dropna("output")) if "output" in nrmsd.dims else float(nrmsd)
