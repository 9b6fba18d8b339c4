"""The command that runs benchmarks."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, Jobs, Json, app, print_json


@app.command
def bench(
    name: str,
    /,
    *,
    runs: int | None = None,
    seed: int | None = None,
    jobs: Jobs = None,
    limit: float | None = None,
    report: Path | None = None,
    as_json: Json = False,
) -> int:
    """Run a shipped benchmark; all competitors in one run.

    Example: mofit bench rastrigin --runs 1000 --report reports/rastrigin

    Parameters
    ----------
    name
        kernel, rastrigin, cec2013, front, sampling, pipeline, withheld-effects or withheld-effects-paper.
    runs
        Runs of each competitor; slow ones may do fewer, which the table tells.
    seed
        Of all runs.
    limit
        Seconds that each competitor may take, where one would take hours; the table tells what came of it.
    report
        Folder to write the table into, as README.md, with the benchmark's figures.
    """
    from mofit.bench import draw_figures, run_benchmark
    from mofit.bench.page import write_page
    from mofit.terminal import show_table

    result = run_benchmark(name, runs=runs, seed=seed, jobs=jobs, limit=limit)
    if report is not None:
        write_page(name, result, report, draw_figures(name, report))
    if as_json:
        print_json(result)
    else:
        show_table(result["rows"], result["settings"])
    return DONE
