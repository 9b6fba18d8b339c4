"""Predicted tests read as plain values: the table of a prediction file, or that of the tests held out in a result."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

#: Numbers of a predicted test, in the order of a table.
NUMBERS = ("nrmsd", "rms", "coverage", "range", "parameter_sd", "noise_sd", "model_error")

#: Where the value of a parameter with a scope comes from in a predicted test, and what a reader is told of it.
SCOPED_SOURCES = {
    "identified": "identified under this condition",
    "fitted": "fitted to this record",
    "pooled": "drawn from the pooled normal",
    "mean": "mean of the identified values, with their spread",
    "nominal": "nominal value, without a spread",
}


def prediction_rows(node: xr.DataTree) -> list[dict[str, Any]]:
    """One entry per predicted test, and output of several; not finite is None.

    Each has ``test``, ``output`` (empty of one), ``unit``, ``role``, ``scored_from`` in s, `NUMBERS`, and ``scoped``,
    the source of every scoped parameter. ``node`` is the root of a prediction (``mofit.prediction/1``), or the group
    ``held_out`` of a result.
    """
    table = node.dataset
    scoped = json.loads(node.attrs["scoped"])
    outputs = [str(name) for name in table["output"].values] if "output" in table["nrmsd"].dims else [""]
    rows = []
    for i, test in enumerate(map(str, table["record"].values)):
        for k, output in enumerate(outputs):
            own = {name: np.atleast_1d(table[name].values[i])[k] for name in NUMBERS}
            rows.append(
                {
                    "test": test,
                    "output": output,
                    "unit": str(table["output_unit"].values[k]) if output else str(table["rms"].attrs["units"]),
                    "role": str(table["role"].values[i]),
                    "scored_from": _number(table["scored_from"].values[i]),
                    **{name: _number(value) for name, value in own.items()},
                    "scoped": scoped.get(test, {}),
                }
            )
    return rows


def prediction_summary(tree: xr.DataTree) -> dict[str, Any]:
    """The numbers of a prediction as ``mofit predict --json`` prints them."""
    attrs = tree.attrs
    return {
        "schema": attrs["schema"],
        "title": attrs["title"],
        "model": attrs["model"],
        "converged": bool(attrs["converged"]),
        **parts_of_band(tree),
        "tests": prediction_rows(tree),
    }


def parts_of_band(node: xr.DataTree) -> dict[str, Any]:
    """What the band of a prediction consists of: ``draws`` and their ``spread``, ``gap``, and ``noise`` by output."""
    attrs = node.attrs
    return {
        "draws": int(attrs["draws"]),
        "spread": str(attrs["spread"]),
        "gap": _number(attrs["gap"]),
        "noise": json.loads(attrs["noise"]),
    }


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None
