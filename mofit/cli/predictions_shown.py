"""Predictions in the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

_WORDS = ("output", "unit", "")


def predictions_table(rows: Sequence[Mapping[str, Any]], title: str) -> Table:
    """A row per predicted test, and output of several: errors, coverage, and the parts of the band."""
    several, roles = any(row["output"] for row in rows), len({row["role"] for row in rows}) > 1
    heads = ["test", *(["output"] if several else []), *([""] if roles else [])]
    heads += ["NRMSD", "rms error", "in the 90 % band", "sd: parameters", "noise", "model error", "unit"]
    table = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0))
    for k, head in enumerate(heads):
        table.add_column(head, justify="left" if k == 0 or head in _WORDS else "right", no_wrap=k == 0)
    for row in rows:
        words = [row["test"], *([row["output"]] if several else []), *([row["role"]] if roles else [])]
        numbers = [_percent(row["nrmsd"]), _number(row["rms"]), _percent(row["coverage"])]
        numbers += [_number(row[key]) for key in ("parameter_sd", "noise_sd", "model_error")]
        table.add_row(*words, *numbers, row["unit"])
    return table


def scoped_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is told of parameters with a value per test or condition: tests alike in one line."""
    from mofit.results import SCOPED_SOURCES

    tests: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for source in dict.fromkeys(row["scoped"].values()):
            names = ", ".join(name for name, own in row["scoped"].items() if own == source)
            own = tests.setdefault((source, names), [])
            own += [row["test"]] if row["test"] not in own else []
    return [f"{SCOPED_SOURCES[source]}: {names} ({', '.join(own)})" for (source, names), own in tests.items()]


def show_prediction(summary: Mapping[str, Any], folder: Path, console: Console) -> None:
    """The table of a prediction, and what its band consists of."""
    if not summary["converged"]:
        console.print("The run did not converge, or was not sampled.", style="bold red")
    console.print(predictions_table(summary["tests"], summary["title"]))
    for line in scoped_lines(summary["tests"]):
        console.print(line)
    noise = ", ".join(_noise(name, own) for name, own in summary["noise"].items())
    console.print(
        f"Band: {summary['draws']} draws ({summary['spread']}); noise: {noise}; "
        f"model error: {_percent(summary['gap'])} of the range."
    )
    console.print(f"page: {folder / 'prediction.html'}")


def _noise(name: str, own: Mapping[str, Any]) -> str:
    size = f"{own['value']:.3g} {own['unit']}" if own["as"] == "units" else f"{_percent(own['value'])} of the range"
    return f"{name} {size}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.3g} %"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
