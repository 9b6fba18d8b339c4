"""The numbers of a run as one JSON object: what ``mofit identify --json`` prints."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr


def summary(tree: xr.DataTree, run: Path) -> dict[str, Any]:
    """Read a result tree into plain data; numbers that are not finite become None.

    Parameters
    ----------
    tree
        A ``mofit.result/2`` tree.
    run
        Its folder.
    """
    seconds = json.loads(tree.attrs["seconds"])
    units = tree["parameters"].dataset["unit"]
    result = {
        "schema": "mofit.identify/2",
        "run": str(run),
        "converged": bool(tree.attrs["converged"]),
        "seconds": {"total": round(sum(seconds.values()), 3), **seconds},
        "evaluations": json.loads(tree.attrs["evaluations"]),
        "noise_floor": _per_test(tree.dataset["noise_floor"]),
        "baseline": _baseline(tree),
        "modes": [_mode(name, node, units) for name, node in tree["modes"].children.items()],
        "per_frequency": _per_frequency(tree),
        "warnings": json.loads(tree.attrs["warnings"]),
    }
    return result


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _per_test(values: xr.DataArray) -> dict[str, float | None]:
    return {str(test): _number(value) for test, value in zip(values["test"].values, values.values, strict=True)}


def _baseline(tree: xr.DataTree) -> dict[str, Any] | None:
    if "baseline" not in tree.children:
        return None
    node = tree["baseline"]
    return {"model": node.attrs["model"], "nrmsd": _per_test(node.dataset["nrmsd"])}


def _mode(name: str, node: xr.DataTree, units: xr.DataArray) -> dict[str, Any]:
    entries = {}
    for parameter in node.dataset["parameter"].values:
        at = node.to_dataset(inherit=False).sel(parameter=parameter)
        entries[str(parameter)] = {
            **{key: _number(at[key]) for key in ("value", "mean", "sd", "q05", "q50", "q95")},
            "unit": str(units.sel(parameter=parameter).item()),
            "verdict": str(at["verdict"].item()),
        }
    return {
        "id": name,
        "probability": _number(node.attrs["probability"]),
        "log_evidence": _number(node.attrs["log_evidence"]),
        "nrmsd": _per_test(node.dataset["nrmsd"]),
        "parameters": entries,
    }


def _per_frequency(tree: xr.DataTree) -> list[dict[str, Any]]:
    """One entry per test and minimum, as in the paper's Table 4."""
    if "per_frequency" not in tree.children:
        return []
    node = tree["per_frequency"].dataset
    rows = []
    for test in node["test"].values:
        for minimum in range(node.sizes["minimum"]):
            at = node.sel(test=test).isel(minimum=minimum)
            if not np.isfinite(at["nrmsd"]):
                continue
            rows.append(
                {
                    "test": str(test),
                    "nrmsd": _number(at["nrmsd"]),
                    "parameters": {
                        str(p): _number(v) for p, v in zip(node["parameter"].values, at["value"].values, strict=True)
                    },
                }
            )
    return rows
