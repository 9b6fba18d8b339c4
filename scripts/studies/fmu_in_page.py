"""Tables of the study of FMUs: how often the truth is inside, and estimates beside others."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from any_simulator import INTERVAL
from kept import CODE
from report_page import table

FMUS = {"pythonfmu": "PythonFMU", "exported": "mofit export"}


def former_rows(kind: str, folder: Path | None) -> dict[int, dict[str, Any]]:
    """Rows of a kind that former code made, by campaign."""
    files = [] if folder is None else folder.glob(f"{kind}-*.json")
    return {
        int(number): json.loads(file.read_text(encoding="utf-8"))
        for file in files
        if (number := file.stem.rpartition("-")[2]).isdigit() and file.stem == f"{kind}-{number}"
    }


def compared(rows: Sequence[dict[str, Any]], former: dict[int, dict[str, Any]]) -> str:
    """How far the posteriors of campaigns are from those of former code."""
    both = [(row, former[number]) for number, row in enumerate(rows) if number in former]
    if not both:
        return "no campaign of both"
    (mean, sd), (old_mean, old_sd) = (
        (np.array([row[key] for row in side]) for key in ("mean", "sd")) for side in zip(*both, strict=True)
    )
    shift, ratio = np.abs(mean - old_mean) / old_sd, sd / old_sd
    return (
        f"{len(both)} campaigns of both: means within {shift.max():.3f} sd (root mean square "
        f"{np.sqrt(np.mean(shift**2)):.3f}), sd ratio {ratio.min():.3f} to {ratio.max():.3f}"
    )


def coverage_line(kind: str, code: str, rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """How often the truth is inside."""
    place = np.array([row["place"] for row in rows])
    inside = (place >= INTERVAL[0]) & (place <= INTERVAL[1])
    used = [row["simulations"] for row in rows]
    return (
        FMUS[kind], code, f"{len(rows)}", f"{100 * inside.mean():.1f} % of {inside.size}",
        f"{100 * np.sqrt(0.09 / inside.size):.1f} %", f"{min(used)} to {max(used)}",
        f"{max(row['error'] for row in rows):.2g}", f"{np.median([row['seconds'] for row in rows]):.1f}",
    )  # fmt: skip


def calibration(made: dict[str, list[dict[str, Any]]], former: dict[str, dict[int, dict[str, Any]]]) -> list[str]:
    """How often the truth is inside, by this code and by former code."""
    columns = ("FMU by", "code", "campaigns", "truth in the 90 % interval", "standard error if it is 90 %",
               "simulations", "largest error of an emulator, nats", "s (median)")  # fmt: skip
    lines, notes = [], []
    for kind, rows in made.items():
        lines.append(coverage_line(kind, CODE, rows))
        if former[kind]:
            lines.append(coverage_line(kind, "former", list(former[kind].values())))
            notes.append(f"{FMUS[kind]}, {compared(rows, former[kind])}.")
    return ["## Calibration", "", *table(columns, lines), *notes, *([""] if notes else [])]


def beside_line(what: str, centres: Any, rows: Sequence[dict[str, Any]], equations: Sequence[dict[str, Any]]) -> tuple:
    """Estimates beside the posteriors of the equations."""
    there, sd = (np.array([row[key] for row in equations]) for key in ("mean", "sd"))
    shift = np.abs(np.array(centres) - there) / sd
    ratio = np.array([row["sd"] for row in rows]) / sd if "sd" in rows[0] else None
    return (
        what, f"{shift.max():.4f}", "-" if ratio is None else f"{ratio.min():.3f} to {ratio.max():.3f}",
        f"{np.median([row.get('simulations', 0) for row in rows]):.0f}",
        f"{np.median([row['seconds'] for row in rows]):.1f}",
    )  # fmt: skip
