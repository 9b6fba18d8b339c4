"""Commands on finished runs: report, runs, open, uncertainty."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, NOT_CONVERGED, NOT_IDENTIFIABLE, FinishedRun, Json, app, print_json, say


@app.command
def report(run: FinishedRun, /, *, as_json: Json = False) -> int:
    """Rebuild the HTML report of a run.

    Example: mofit report runs/my-campaign-maxwell_tyre
    """
    from mofit.report import build_report

    page = build_report(run)
    if as_json:
        print_json({"schema": "mofit.report/1", "report": str(page)})
    else:
        print(page)
    return DONE


@app.command
def runs(folder: Path = Path("runs"), /, *, as_json: Json = False) -> int:
    """Write runs.html into a folder of runs: what was run, verdicts, errors beside the noise, runs side by side.

    Example: mofit runs runs

    Parameters
    ----------
    folder
        Folder that holds the runs.
    """
    from dataclasses import asdict

    from mofit.cli.runs_shown import show_runs
    from mofit.runtime.output_file import output_file
    from mofit.workflows.runs import find_runs
    from mofit.workflows.runs_page import PAGE, write_runs

    entries = find_runs(folder)
    with output_file(folder / PAGE, "folder", force=True):
        page = write_runs(entries, folder)
    if as_json:
        print_json({"schema": "mofit.runs/1", "page": str(page), "runs": [asdict(entry) for entry in entries]})
    else:
        show_runs(entries, page)
    return DONE


@app.command(name="open")
def open_page(run: Path, /, *, as_json: Json = False) -> int:
    """Open the page of a run, or of a folder of runs, in the browser; without a browser, its path is printed.

    Example: mofit open runs/my-campaign-maxwell_tyre

    Parameters
    ----------
    run
        Folder of a run or of a batch, or a folder of runs for which mofit runs has written its page.
    """
    import webbrowser

    from mofit.workflows.runs import page_of

    page = page_of(run)
    opened = webbrowser.open(page.resolve().as_uri())
    if as_json:
        print_json({"schema": "mofit.open/1", "page": str(page), "opened": opened})
    else:
        print(page)
    if not opened:
        say("mofit: there is no browser here; open the file above in one.")
    return DONE


@app.command
def uncertainty(run: FinishedRun, /, *, parameter: tuple[str, ...] = (), as_json: Json = False) -> int:
    """Build the uncertainty page of a run: intervals, correlations, predictive bands, homogeneity of the tests.

    Example: mofit uncertainty runs/my-campaign-maxwell_tyre --parameter d_M

    Parameters
    ----------
    parameter
        Exit code 4 if the data do not identify this parameter; repeatable.
    """
    from mofit.report import build_uncertainty
    from mofit.report.uncertainty.table import uncertainty_summary
    from mofit.results import open_result

    tree = open_result(run)
    table = uncertainty_summary(tree, parameter)
    page = build_uncertainty(run, tree)
    if as_json:
        print_json({"schema": "mofit.uncertainty/1", "uncertainty": str(page), **table})
    else:
        print(page)
    if not table["converged"]:
        return NOT_CONVERGED
    return NOT_IDENTIFIABLE if table["not_identifiable"] else DONE
