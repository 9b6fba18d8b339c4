"""A comparison of procedures as a person sees it in the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from mofit.terminal import terminal_console

#: Parameters that have room side by side.
_ABREAST = 3
_COLOURS = {
    "identifiable": "green",
    "only in a combination": "yellow",
    "one-sided": "yellow",
    "not identifiable": "red",
}


def show_comparison(told: Mapping[str, Any], mends: Sequence[str]) -> None:
    """Procedures × parameters, then why.

    Parameters
    ----------
    told
        What ``--json`` prints.
    mends
        What would make parameters identifiable that no procedure identifies, in sentences.
    """
    out = terminal_console()
    names = list(told["procedures"][0]["parameters"])
    out.print(_wide(told, names) if len(names) <= _ABREAST else _long(told))
    values = ", ".join(f"{name} {told['values'][name]['value']:.4g} {told['values'][name]['unit']}" for name in names)
    out.print(
        f"Expected standard deviation in % of the value, median over {told['points']} parameter sets around {values}; "
        "per min: after 60 s of the procedure. *: the verdict depends on the parameter set.",
        highlight=False,
    )
    for row in told["procedures"]:
        for entry in row["parameters"].values():
            if entry["verdict"] != "identifiable":
                out.print(f"{row['name']}: {entry['sentence']}", highlight=False)
    for name, parameters in told.get("posterior", {}).items():
        words = ", ".join(
            f"{parameter} {own['mean']:.4g} ± {own['sd']:.2g} ({own['verdict']})"
            for parameter, own in parameters.items()
        )
        sure = "" if all(own["converged"] for own in parameters.values()) else "; NOT CONVERGED"
        out.print(f"{name}: posterior of simulated data: {words}{sure}", highlight=False)
    for sentence in (*told["notes"], *mends):
        out.print(sentence, highlight=False)


def _wide(told: Mapping[str, Any], names: Sequence[str]) -> Table:
    """A row per procedure, parameters side by side."""
    table = Table("procedure", box=SIMPLE, padding=(0, 1, 0, 0))
    table.columns[0].no_wrap = True
    table.add_column("time", justify="right")
    for name in names:
        table.add_column(f"{name}: sd", justify="right")
        table.add_column("per min", justify="right")
        table.add_column("verdict")
    for row in told["procedures"]:
        cells = [cell for entry in row["parameters"].values() for cell in _cells(entry)]
        table.add_row(row["name"], f"{row['seconds']:.0f} s", *cells)
    return table


def _long(told: Mapping[str, Any]) -> Table:
    """A row per procedure and parameter."""
    table = Table("procedure", "parameter", box=SIMPLE, padding=(0, 1, 0, 0))
    for heading in ("time", "sd", "per min"):
        table.add_column(heading, justify="right")
    table.add_column("verdict")
    for row in told["procedures"]:
        for name, entry in row["parameters"].items():
            table.add_row(row["name"], name, f"{row['seconds']:.0f} s", *_cells(entry))
    return table


def _cells(entry: Mapping[str, Any]) -> list[str]:
    star = "*" if len(entry["verdicts"]) > 1 else ""
    return [
        percent(entry["relative_sd"]),
        percent(entry["relative_sd_after_60_s"]),
        f"[{_COLOURS[entry['verdict']]}]{entry['verdict']}[/]{star}",
    ]


def percent(value: float) -> str:
    """A ratio in per cent, two digits."""
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:.0f} %"
