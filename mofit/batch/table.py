"""The rows of a batch as a table in a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mofit.batch.tasks import Row
from mofit.result import atomic_path


def columns(rows: Sequence[Row], what: str) -> list[dict[str, Any]]:
    """Every row as a flat mapping, in SI units: name, state, conditions, then what was found.

    Of an identification: value, mean, standard deviation, 90 % interval and verdict of every parameter in the mode of
    most weight. Of a diagnosis: the verdict, and for every effect its probability and size.
    """
    return [
        {
            "campaign": row.name,
            "state": row.state,
            **{f"{name} [{row.units.get(name, '')}]": value for name, value in row.conditions.items()},
            **(_identified(row) if what == "identify" else _diagnosed(row)),
            "message": row.message,
        }
        for row in rows
    ]


def _identified(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, entry in row.parameters.items():
        unit = entry["unit"]
        found |= {f"{name} [{unit}]": entry["mean"]}
        found |= {f"{name} {key} [{unit}]": entry[key] for key in ("sd", "q05", "q95")}
        found[f"{name} verdict"] = entry["verdict"]
    return found


def _diagnosed(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {"verdict": row.summary.get("verdict", "")}
    for effect in row.summary.get("effects", []):
        found[f"{effect['name']} probability"] = effect["probability"]
        found[f"{effect['name']} [{effect['unit']}]"] = effect["size"]
    return found


def write_table(rows: Sequence[Row], what: str, path: Path) -> None:
    """Write the table as CSV."""
    flat = columns(rows, what)
    names = list(dict.fromkeys(key for row in flat for key in row if key != "message"))
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [*names, "message"], restval="")
        writer.writeheader()
        writer.writerows(flat)
