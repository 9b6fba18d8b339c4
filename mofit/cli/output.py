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

from mofit.cli.laws_shown import laws_table, populations_table
from mofit.cli.predictions_shown import predictions_table, scoped_lines
from mofit.results import outcome_sentences, simulations_line
from mofit.runtime.progress import Progress as Listener


@contextmanager
def progress_bar() -> Iterator[Listener]:
    """A listener that draws one bar per stage on standard error; plain words where that is no terminal."""
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:

        def remark(stage: str, done: float, total: float, note: str) -> None:
            if total == 0 and note:  # made outside any count: only that should a log keep
                console.print(f"mofit: {note}")

        yield remark
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


#: Tables are not squeezed below this many columns where the output is no terminal.
WIDTH = 120
#: Parameters of a comparison that have room side by side.
_ABREAST = 3
#: Single tests of a design that are shown.
_BEST = 5
_COLOURS = {"good": "green", "fair": "yellow", "bad": "red"}


def terminal_console() -> Console:
    """Standard output; wide enough for a table where that is no terminal."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    return console


def table_of(*heads: str, words: Sequence[str] = (), title: str | None = None) -> Table:
    """A table; the first column and those among ``words`` are aligned left, numbers right."""
    table = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0))
    for k, head in enumerate(heads):
        table.add_column(head, justify="left" if k == 0 or head in words else "right", no_wrap=k == 0)
    return table


def show_identification(summary: Mapping[str, Any], folder: Path) -> None:
    """The modes of a finished run, one table each."""
    console = terminal_console()
    for finding in summary["findings"]:
        console.print(finding["text"], style="bold red" if finding["level"] == "untrusted" else "bold yellow")
    for sentence, style in outcome_sentences(summary):
        console.print(sentence, style=style)
    for warning in summary["warnings"][len(summary["findings"]) :]:
        console.print(f"warning: {warning}")
    for mode in summary["modes"]:
        worst = max(mode["nrmsd"].values())
        title = f"{mode['id']}: probability {mode['probability']:.3g}, NRMSD up to {100 * worst:.3g} %"
        heads = ("parameter", "MAP", "mean", "sd", "5 %", "95 %", "unit", "verdict")
        table = table_of(*heads, words=("unit", "verdict"), title=title)
        for name, entry in mode["parameters"].items():
            keys = ("value", "mean", "sd", "q05", "q95")
            numbers = ["–" if entry[key] is None else f"{entry[key]:.4g}" for key in keys]
            table.add_row(name, *numbers, entry["unit"], entry["verdict"])
        console.print(table)
        if "scoped" in mode:
            console.print(_scoped(mode))
    if summary.get("laws"):
        console.print(laws_table(summary["laws"]))
        if "populations" in summary["laws"]:
            console.print(populations_table(summary["laws"]))
    if any(" / " in name for mode in summary["modes"] for name in mode["nrmsd"]):
        console.print(_errors_of_outputs(summary))
    if summary.get("held_out"):
        console.print(predictions_table(summary["held_out"]["tests"], "Predicted: held out and fitted"))
        for line in scoped_lines(summary["held_out"]["tests"]):
            console.print(line)
    if summary["search"]:
        more = "--simulations" if summary.get("simulations") else "--evaluations"
        console.print(_search_line(summary["search"], more))
    if summary.get("simulations"):
        console.print(f"Simulator: {simulations_line(summary['simulations'])}")
    console.print(f"{summary['seconds']['total']:.1f} s; report: {folder / 'report.html'}")


#: values of a scoped parameter that a terminal shows; the page and --json have all
_SHOWN = 12


def _scoped(mode: Mapping[str, Any]) -> Table:
    """Parameters with a value per test or condition: estimate and standard deviation of each."""
    title = f"{mode['id']}: values per test or condition (± standard deviation)"
    table = table_of("parameter", "of", "estimate", "sd", "unit", words=("of", "unit"), title=title)
    for name, entry in mode["scoped"].items():
        for label, own in [*entry["values"].items()][:_SHOWN]:
            side = {-1: " (lower end of its range)", 0: "", 1: " (upper end of its range)"}[own["at_bound"]]
            table.add_row(name, label + side, f"{own['value']:.4g}", f"{own['sd']:.2g}", entry["unit"])
        if (more := len(entry["values"]) - _SHOWN) > 0:
            table.add_row(name, f"and {more} more: see the report", "", "", "")
    return table


def _errors_of_outputs(summary: Mapping[str, Any]) -> Table:
    """NRMSD of every test and output, of the best mode and of the noise; no name of a test holds a ``/``."""
    best = summary["modes"][0]
    table = table_of(
        "test", "output", "NRMSD", "noise", words=("output",), title=f"{best['id']}: NRMSD of every output"
    )
    for name, floor in summary["noise_floor"].items():
        values = (best["nrmsd"][name], floor)
        cells = ["–" if value is None else f"{100 * value:.3g} %" for value in values]
        table.add_row(*name.split(" / ", 1), *cells)
    return table


def _search_line(search: Mapping[str, Any], more: str) -> str:
    """What the search found, whether more may be undiscovered, and the option that gives it more."""
    found = ", ".join(f"{number} by the {stage}" for stage, number in search["found_by"].items())
    line = f"Search: {search['method']}, {search['evaluations']} evaluations, {search['minima']} minima"
    line += f" ({found})." if found else "."
    if search["complete"] is None:
        return line
    if search["expected_undiscovered"] is None:
        return f"{line} The search was not complete: how many minima are undiscovered is not known."
    spent = (
        ""
        if search["complete"]
        else f" The budget was spent before this number fell below its limit; {more} gives more."
    )
    return f"{line} Expected undiscovered: {search['expected_undiscovered']:.2g}.{spent}"


def show_comparison(summary: Mapping[str, Any], augmentations: Sequence[str]) -> None:
    """Experiments × parameters, then why, of what ``--json`` prints; last what would make the others identifiable."""
    from mofit.experimental_design.identifiability import IDENTIFIABLE

    console = terminal_console()
    names = list(summary["experiments"][0]["parameters"])
    console.print(_abreast(summary, names) if len(names) <= _ABREAST else _stacked(summary))
    values = ", ".join(
        f"{name} {summary['values'][name]['value']:.4g} {summary['values'][name]['unit']}" for name in names
    )
    sentences = [
        f"Expected standard deviation in % of the value, median over {summary['samples']} parameter samples around "
        f"{values}; per min: after 60 s of the experiment. *: the verdict depends on the parameter sample."
    ]
    sentences += [
        f"{row['name']}: {entry['sentence']}"
        for row in summary["experiments"]
        for entry in row["parameters"].values()
        if entry["verdict"] != IDENTIFIABLE
    ]
    for name, parameters in summary.get("posterior", {}).items():
        estimates = ", ".join(
            f"{parameter} {own['mean']:.4g} ± {own['sd']:.2g} ({own['verdict']})"
            for parameter, own in parameters.items()
        )
        converged = "" if all(own["converged"] for own in parameters.values()) else "; NOT CONVERGED"
        sentences.append(f"{name}: posterior of simulated data: {estimates}{converged}")
    for sentence in (*sentences, *summary["notes"], *augmentations):
        console.print(sentence)


def _abreast(summary: Mapping[str, Any], names: Sequence[str]) -> Table:
    """A row per experiment, parameters side by side."""
    heads = [head for name in names for head in (f"{name}: sd", "per min", "verdict")]
    table = table_of("experiment", "time", *heads, words=("verdict",))
    for row in summary["experiments"]:
        cells = [cell for entry in row["parameters"].values() for cell in _cells(entry)]
        table.add_row(row["name"], f"{row['seconds']:.0f} s", *cells)
    return table


def _stacked(summary: Mapping[str, Any]) -> Table:
    """A row per experiment and parameter."""
    table = table_of("experiment", "parameter", "time", "sd", "per min", "verdict", words=("parameter", "verdict"))
    for row in summary["experiments"]:
        for name, entry in row["parameters"].items():
            table.add_row(row["name"], name, f"{row['seconds']:.0f} s", *_cells(entry))
    return table


def _cells(entry: Mapping[str, Any]) -> list[str]:
    from mofit.experimental_design.text import GRADES, percent

    star = "*" if len(entry["verdicts"]) > 1 else ""
    colour = _COLOURS[GRADES[entry["verdict"]]]
    return [
        percent(entry["relative_sd"]),
        percent(entry["relative_sd_after_60_s"]),
        f"[{colour}]{entry['verdict']}[/]{star}",
    ]


def show_design(summary: Mapping[str, Any]) -> None:
    """The tests to run first, then what they give, then what else was evaluated; of what ``--json`` prints."""
    from mofit.experimental_design.text import criterion_text, settings_text, value_text

    console = terminal_console()
    table = table_of("run next", "kind", "settings", "times", "time", words=("kind", "settings"))
    for test in summary["design"]:
        table.add_row(test["name"], test["kind"], settings_text(test), str(test["times"]), f"{test['seconds']:.0f} s")
    console.print(table)
    heads = ("parameter", "sd before", "sd after", "unit", "before", "after", "verdict after")
    table = table_of(*heads, words=("unit", "verdict after"))
    for name, entry in summary["parameters"].items():
        table.add_row(
            name, f"{entry['sd_before']:.3g}", f"{entry['sd']:.3g}", entry["unit"],
            f"{100 * entry['relative_sd_before']:.2g} %", f"{100 * entry['relative_sd']:.2g} %", entry["verdict"],
        )  # fmt: skip
    console.print(table)
    console.print(criterion_text(summary))
    table = table_of("best single tests", "time", "criterion")
    for test in summary["singles"][:_BEST]:
        table.add_row(test["name"], f"{test['seconds']:.0f} s", value_text(summary, test["value"]))
    console.print(table)
    infeasible = ", ".join(f"{number} by {reason}" for reason, number in summary["infeasible"].items())
    candidates = f"{summary['candidates']} candidates" + (f"; infeasible: {infeasible}" if infeasible else "") + "."
    for sentence in (candidates, *summary["notes"], *summary["not_identifiable"]):
        console.print(sentence)
