"""Identified parameters with their uncertainty, as text."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from mofit.summary import summary

#: numbers of a parameter, in the order of the columns: refined minimum, posterior mean and sd, 5, 50 and 95 % quantiles
NUMBERS = ("value", "mean", "sd", "q05", "q50", "q95")
_ORIGIN = ("title", "model", "campaign_title", "campaign_source", "campaign_hash", "mofit_version", "created", "seed")


def parameters_csv(tree: xr.DataTree) -> str:
    """One row per solution and parameter, best solution first.

    Columns: ``mode``, ``weight`` (posterior), ``parameter``, ``value`` (refined minimum), ``mean``, ``sd``, ``q05``,
    ``q50``, ``q95`` (posterior), ``unit`` and ``verdict``. A parameter that was held has a value only, and the verdict
    ``held``.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("mode", "weight", "parameter", *NUMBERS, "unit", "verdict"))
    for mode, name, entry in _rows(tree):
        numbers = ("" if entry[key] is None else repr(entry[key]) for key in NUMBERS)
        writer.writerow((mode["id"], _plain(mode["weight"]), name, *numbers, entry["unit"], entry["verdict"]))
    return text.getvalue()


def parameters_toml(tree: xr.DataTree) -> str:
    """A table ``[modes.c1.parameters.NAME]`` per solution and parameter, best solution first.

    Keys as the columns of `parameters_csv`; a number that is not known is left out.
    """
    lines = [f"{key} = {_text(tree.attrs[key])}" for key in _ORIGIN if key in tree.attrs]
    lines.append(f"converged = {'true' if tree.attrs['converged'] else 'false'}")
    last = None
    for mode, name, entry in _rows(tree):
        if mode["id"] != last:
            last = mode["id"]
            lines += ["", f"[modes.{last}]", f"weight = {_plain(mode['weight'])}"]
            lines += [f"nrmsd = {{ {_pairs(mode['nrmsd'])} }}"]
        lines += ["", f"[modes.{last}.parameters.{name}]"]
        lines += [f"{key} = {entry[key]!r}" for key in NUMBERS if entry[key] is not None]
        lines += [f"unit = {_text(entry['unit'])}", f"verdict = {_text(entry['verdict'])}"]
    return "\n".join([*lines, ""])


def held_values(tree: xr.DataTree) -> dict[str, float]:
    """Parameters that the run did not identify, with the values it held them at (``--fix``)."""
    return {name: float(value) for name, value in json.loads(tree.attrs["configuration"]).get("fixed", {}).items()}


def _held_units(tree: xr.DataTree) -> dict[str, str]:
    """Units of the held parameters; none in a run that was written before they were kept."""
    held = tree["held"].data_vars if "held" in tree.children else {}
    return {str(name): str(variable.attrs["units"]) for name, variable in held.items()}


def _rows(tree: xr.DataTree) -> Iterator[tuple[dict[str, Any], str, dict[str, Any]]]:
    units = _held_units(tree)
    held = {
        name: {**dict.fromkeys(NUMBERS), "value": value, "unit": units.get(name, "SI"), "verdict": "held"}
        for name, value in held_values(tree).items()
    }
    for mode in summary(tree, Path())["modes"]:
        for name, entry in {**mode["parameters"], **held}.items():
            yield mode, name, entry


def _pairs(values: Mapping[str, float | None]) -> str:
    return ", ".join(f"{_text(name)} = {value!r}" for name, value in values.items() if value is not None)


def _plain(number: float | None) -> str:
    return "nan" if number is None or not math.isfinite(number) else repr(number)


def _text(value: Any) -> str:
    """A TOML string or number; JSON's escapes are TOML's, but for the delete sign."""
    plain = value.item() if hasattr(value, "item") else value
    return json.dumps(plain, ensure_ascii=False).replace("\x7f", "\\u007f")
