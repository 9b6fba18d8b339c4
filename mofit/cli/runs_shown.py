"""A folder of runs in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from mofit.cli.output import terminal_console

if TYPE_CHECKING:
    from mofit.workflows.runs import RunEntry

_COLOURS = {"good": "green", "fair": "yellow", "bad": "red"}


def show_runs(entries: Sequence[RunEntry], page: Path) -> None:
    """A row per run: verdict, error beside the noise, gap, warnings."""
    from mofit.workflows.runs import mean

    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))
    for head in ("run", "verdict", "NRMSD %", "noise %", "gap", "warnings"):
        table.add_column(head, justify="left" if head in ("run", "verdict") else "right")
    for entry in entries:
        errors = (f"{100 * mean(values):.3g}" if values else "–" for values in (entry.nrmsd, entry.noise_floor))
        gap = "–" if entry.gap is None else f"{entry.gap:.3g} {entry.gap_unit}"
        verdict = f"[{_COLOURS[entry.grade]}]{escape(entry.verdict)}[/]"
        table.add_row(escape(entry.name), verdict, *errors, gap, str(len(entry.warnings)))
    console = terminal_console()
    console.print(table)
    console.print(f"page: {page}")
