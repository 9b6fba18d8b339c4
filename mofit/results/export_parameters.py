"""Identified parameters with their uncertainty, as TOML or CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from mofit.results.parameters import fixed_values
from mofit.results.summary import summary
from mofit.runtime.toml import toml_value

#: numbers of a parameter, in the order of the columns: MAP estimate, posterior mean and sd, 5, 50 and 95 % quantiles
NUMBERS = ("value", "mean", "sd", "q05", "q50", "q95")
_ORIGIN = ("title", "model", "campaign_title", "campaign_source", "campaign_hash", "mofit_version", "created", "seed")


def parameters_csv(tree: xr.DataTree) -> str:
    """One row per mode and parameter, best mode first.

    Columns: ``mode``, ``probability`` (of the mode), ``parameter``, ``value`` (MAP estimate), ``mean``, ``sd``,
    ``q05``, ``q50``, ``q95`` (posterior), ``unit`` and ``verdict``. A parameter that was fixed has a value
    only, and the verdict ``fixed``.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("mode", "probability", "parameter", *NUMBERS, "unit", "verdict"))
    for mode, name, entry in _rows(tree):
        numbers = ("" if entry[key] is None else repr(entry[key]) for key in NUMBERS)
        writer.writerow((mode["id"], _plain(mode["probability"]), name, *numbers, entry["unit"], entry["verdict"]))
    return text.getvalue()


def parameters_toml(tree: xr.DataTree) -> str:
    """A table ``[modes.m1.parameters.NAME]`` per mode and parameter, best mode first.

    Keys as the columns of `parameters_csv`; a number that is not known is left out.
    """
    lines = [f"{key} = {toml_value(tree.attrs[key])}" for key in _ORIGIN if key in tree.attrs]
    lines.append(f"converged = {'true' if tree.attrs['converged'] else 'false'}")
    last = None
    for mode, name, entry in _rows(tree):
        if mode["id"] != last:
            last = mode["id"]
            lines += ["", f"[modes.{last}]", f"probability = {_plain(mode['probability'])}"]
            lines += [f"nrmsd = {{ {_pairs(mode['nrmsd'])} }}"]
        lines += ["", f"[modes.{last}.parameters.{name}]"]
        lines += [f"{key} = {entry[key]!r}" for key in NUMBERS if entry[key] is not None]
        lines += [f"unit = {toml_value(entry['unit'])}", f"verdict = {toml_value(entry['verdict'])}"]
    return "\n".join([*lines, ""])


def _fixed_units(tree: xr.DataTree) -> dict[str, str]:
    fixed = tree["fixed"].data_vars if "fixed" in tree.children else {}
    return {str(name): str(variable.attrs["units"]) for name, variable in fixed.items()}


def _rows(tree: xr.DataTree) -> Iterator[tuple[dict[str, Any], str, dict[str, Any]]]:
    units = _fixed_units(tree)
    fixed = {
        name: {**dict.fromkeys(NUMBERS), "value": value, "unit": units.get(name, "SI"), "verdict": "fixed"}
        for name, value in fixed_values(tree).items()
    }
    for mode in summary(tree, Path())["modes"]:
        for name, entry in {**mode["parameters"], **fixed}.items():
            yield mode, name, entry


def _pairs(values: Mapping[str, float | None]) -> str:
    return ", ".join(f"{toml_value(name)} = {value!r}" for name, value in values.items() if value is not None)


def _plain(number: float | None) -> str:
    return "nan" if number is None or not math.isfinite(number) else repr(number)
