"""The benchmarks from the command line: ``make bench NAME=kernel ARGS=...``."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from benchmarks import draw_figures, run_benchmark
from mofit.errors import InputError
from studies.report_page import table

app = App(name="make bench NAME=...", help_format="plaintext")


@app.default
def bench(
    name: str,
    /,
    *,
    runs: int | None = None,
    seed: int | None = None,
    jobs: int | None = None,
    limit: float | None = None,
    peers: int | None = None,
    report: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Run a benchmark; all competitors in one run.

    Example: make bench NAME=rastrigin ARGS="--runs 1000 --report reports/rastrigin"

    Parameters
    ----------
    name
        kernel, rastrigin, cec2013, front, sampling, pipeline, small_pipeline, withheld_effects,
        withheld_effects_paper, withheld_speed or withheld_speed_bundled.
    runs
        Runs of each competitor; slow ones may do fewer, which the table shows.
    seed
        Of all runs.
    jobs
        Threads; results do not depend on it. All cores by default.
    limit
        Seconds that each competitor may take, where one would take hours; the table shows how far it came.
    peers
        Runs of the searches beside the default one at most, where a run takes minutes; with 0 they are left out.
    report
        Folder to write the table into, as README.md, with the benchmark's figures.
    as_json
        Print one JSON object on standard output.
    """
    result = run_benchmark(name, runs=runs, seed=seed, jobs=jobs, limit=limit, peers=peers)
    if report is not None:
        write_report(name, result, report)
    if as_json:
        print(json.dumps(result))
    else:
        _show(result["rows"], result["settings"])


def write_report(name: str, result: Mapping[str, Any], folder: Path) -> None:
    """Write the table of a benchmark with its figures into a folder, or copy the ``report`` that its settings name."""
    settings = result["settings"]
    if "report" in settings:
        shutil.copytree(settings["report"], folder, dirs_exist_ok=True)
        return
    pictures = draw_figures(name, folder)
    options = "".join(f" --{key} {settings[key]}" for key in ("runs", "seed", "limit", "peers") if key in settings)
    lines = [
        f"# Benchmark: {name}",
        "",
        f'Written by `make bench NAME={name} ARGS="{options.strip()} --report {folder.as_posix()}"`.',
        "",
        *table(_headings(result["rows"]), _cells(result["rows"])),
        *(f"- {key.replace('_', ' ')}: {value}" for key, value in settings.items()),
        "",
        *(f"![{caption}]({file})\n\n{caption}\n" for file, caption in pictures.items()),
    ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "README.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def _show(rows: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> None:
    """Rows as a table, the settings below."""
    console = Console()
    shown = Table(*_headings(rows), box=SIMPLE, padding=(0, 1, 0, 0))
    shown.columns[0].no_wrap = True
    for cells in _cells(rows):
        shown.add_row(*cells)
    console.print(shown)
    for key, value in settings.items():
        console.print(f"{key.replace('_', ' ')}: {value}", highlight=False)


def _columns(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every key of any row, in the order of first appearance."""
    return list(dict.fromkeys(key for row in rows for key in row))


def _headings(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    return [column.replace("_", " ") for column in _columns(rows)]


def _cells(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    return [[_cell(row.get(column)) for column in _columns(rows)] for row in rows]


def _cell(value: Any) -> str:
    """A value as text: four digits of a float, nothing for None."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    try:
        app()
    except InputError as error:
        sys.exit(f"bench: {error}")
