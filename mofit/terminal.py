"""What a person sees in the terminal: progress while working, tables when done."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from mofit.progress import Progress as Listener


@contextmanager
def progress_bar() -> Iterator[Listener]:
    """A listener that draws one bar per stage on standard error; plain words where that is no terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _notes_only(console)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=console) as bar:
        tasks: dict[str, Any] = {}

        def listen(stage: str, done: float, total: float, note: str) -> None:
            if stage not in tasks:
                for name in tasks:
                    bar.update(tasks[name], completed=bar.tasks[tasks[name]].total or 1)
                tasks[stage] = bar.add_task(stage, total=total or None, note=note)
            bar.update(tasks[stage], completed=done, total=total or None, note=note)

        yield listen


def _notes_only(console: Console) -> Listener:
    """Only what a log should keep: remarks made outside any count."""

    def listen(stage: str, done: float, total: float, note: str) -> None:
        if total == 0 and note:
            console.print(f"mofit: {note}", highlight=False)

    return listen


#: Tables are not squeezed below this many columns where the output is no terminal.
WIDTH = 120


def terminal_console() -> Console:
    """Standard output; wide enough for a table where that is no terminal."""
    console = Console()
    return console if console.is_terminal else Console(width=WIDTH)


def show_identification(summary: Mapping[str, Any], folder: Path) -> None:
    """The modes of a finished run, one table each."""
    console = terminal_console()
    for mode in summary["modes"]:
        worst = max(mode["nrmsd"].values())
        table = Table(title=f"{mode['id']}: weight {mode['weight']:.3g}, NRMSD up to {100 * worst:.3g} %")
        for heading in ("parameter", "minimum", "mean", "sd", "5 %", "95 %", "unit", "verdict"):
            table.add_column(heading, justify="left" if heading in ("parameter", "unit", "verdict") else "right")
        for name, entry in mode["parameters"].items():
            numbers = [f"{entry[key]:.4g}" for key in ("value", "mean", "sd", "q05", "q95")]
            table.add_row(name, *numbers, entry["unit"], entry["verdict"])
        console.print(table)
    for warning in summary["warnings"]:
        console.print(f"warning: {warning}", highlight=False)
    if not summary["converged"]:
        console.print("NOT CONVERGED: don't trust the spread; see the report.", style="bold red")
    console.print(f"{summary['seconds']['total']:.1f} s; report: {folder / 'report.html'}", highlight=False)


def show_diagnosis(found: Mapping[str, Any], folder: Path) -> None:
    """The verdict, the effects, and what to do next."""
    console = terminal_console()
    console.print(found["sentence"], style="bold", highlight=False)
    where = found["where"]
    if where["spots"]:
        console.print(f"Gap: {where['gap']:.3g} {where['unit']} (root mean square of what repeats)", highlight=False)
    if found["effects"]:
        table = Table(box=SIMPLE)
        for heading in ("effect", "probability", "size", "5 %", "95 %", "unit"):
            table.add_column(heading, justify="left" if heading in ("effect", "unit") else "right")
        for effect in found["effects"]:
            sizes = [f"{effect[key]:.4g}" for key in ("size", "size_low", "size_high")]
            table.add_row(effect["name"], f"{effect['probability']:.2f}", *sizes, effect["unit"])
        console.print(table)
    if shrinkage := found["shrinkage"]:
        share = [f"{100 * shrinkage[key]:.1f}" for key in ("confirmed", "low", "high")]
        console.print(
            f"On held-out tests it removes {share[0]} % of the gap ({share[1]} to {share[2]} %).", highlight=False
        )
    if found["next_test"]:
        console.print(found["next_test"]["sentence"], highlight=False)
    console.print(f"{found['seconds']:.1f} s; page: {folder / 'diagnosis.html'}", highlight=False)


def show_table(rows: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> None:
    """Rows of a benchmark as a table, its settings below."""
    from mofit.bench.page import cell, headings

    console = terminal_console()
    table = Table(*(column.replace("_", " ") for column in headings(rows)), box=SIMPLE, padding=(0, 1, 0, 0))
    table.columns[0].no_wrap = True
    for row in rows:
        table.add_row(*(cell(row.get(heading)) for heading in headings(rows)))
    console.print(table)
    for key, value in settings.items():
        console.print(f"{key.replace('_', ' ')}: {value}", highlight=False)
