"""The laws of a run as plain data."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray as xr


def laws_summary(tree: xr.DataTree) -> dict[str, Any] | None:
    """What ``mofit identify --json`` prints of the laws; None where no parameter was looked at over conditions.

    Returns
    -------
    dict
        ``conditions``; ``chi_square`` and ``freedom`` of the estimates of the combinations about the laws;
        ``laws``, a list of ``parameter``, ``condition``, ``law``, ``centre``, ``half_range``, ``unit`` (of the
        condition) and ``log_evidence`` of what it was chosen from, relative to it; ``combinations``, a list of
        ``conditions`` and ``parameters``, by name with ``value``, ``sd``, ``law_low``, ``law`` and ``law_high``. Of
        specimens also ``populations``, by parameter with ``mean``, ``spread`` and their 5 and 95 % quantiles, and
        ``outliers``, a list of ``specimen``, ``parameter``, ``z`` and ``p_value``.
    """
    if "laws" not in tree.children:
        return None
    node = tree.children["laws"].to_dataset(inherit=False)
    rows = []
    for label in node["law"].values:
        own = node.sel(law=label)
        evidence = {
            str(name): float(value)
            for name, value in zip(node["candidate"].values, own["log_evidence"].values, strict=True)
            if np.isfinite(value)
        }
        rows.append(
            {
                "parameter": str(own["parameter"].item()),
                "condition": str(own["condition"].item()),
                "law": str(own["form"].item()),
                "centre": _number(own["centre"]),
                "half_range": _number(own["half_range"]),
                "unit": str(own["unit"].item()),
                "log_evidence": evidence,
            }
        )
    return {
        "conditions": str(node.attrs["conditions"]).split(","),
        "chi_square": float(node.attrs["chi_square"]),
        "freedom": int(node.attrs["freedom"]),
        "laws": rows,
        "combinations": _combinations(tree),
        **_populations(tree),
    }


def _populations(tree: xr.DataTree) -> dict[str, Any]:
    if "populations" not in tree.children["laws"].children:
        return {}
    node = tree.children["laws"].children["populations"].to_dataset(inherit=False)
    keys = ("mean", "mean_low", "mean_high", "spread", "spread_low", "spread_high")
    rows = {
        str(name): {
            **{key: _number(node[key].sel(parameter=name)) for key in keys},
            "unit": str(node["unit"].sel(parameter=name).item()),
            "of_logarithm": bool(node["of_logarithm"].sel(parameter=name)),
        }
        for name in node["parameter"].values
    }
    return {"populations": rows, "outliers": json.loads(node.attrs["outliers"])}


def _combinations(tree: xr.DataTree) -> list[dict[str, Any]]:
    cells = tree.children["laws"].children["cells"].to_dataset(inherit=False)
    names = str(tree.children["laws"].attrs["conditions"]).split(",")
    found = []
    for cell in cells["cell"].values:
        own = cells.sel(cell=cell)
        parameters = {
            str(name): {
                "value": _number(own["value"].sel(parameter=name)),
                "sd": _number(own["sd"].sel(parameter=name)),
                "law_low": _number(own["law_low"].sel(parameter=name)),
                "law": _number(own["law_median"].sel(parameter=name)),
                "law_high": _number(own["law_high"].sel(parameter=name)),
                "unit": str(own["unit"].sel(parameter=name).item()),
            }
            for name in own["parameter"].values
        }
        found.append({"conditions": {name: float(own[name]) for name in names}, "parameters": parameters})
    return found


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None
