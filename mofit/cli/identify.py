"""Commands on runs: identify, report, uncertainty."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, NOT_CONVERGED, NOT_IDENTIFIABLE, app, print_json
from mofit.cli.options import (
    Bounds,
    Effects,
    Fixed,
    Jobs,
    Joint,
    Json,
    ModelName,
    Search,
    Seed,
    Tests,
    by_name,
    cores,
    range_by_name,
)
from mofit.errors import InputError
from mofit.identification.search_registry import DEFAULT_SEARCH


@app.command
def identify(
    file: Path | None = None,
    /,
    *,
    all_freqs: bool = False,
    freq: tuple[float, ...] = (),
    test: Tests = (),
    model: ModelName = None,
    effect: Effects = (),
    search: Search = DEFAULT_SEARCH,
    weights: tuple[str, ...] = (),
    bounds: Bounds = (),
    fix: Fixed = (),
    joint: Joint = False,
    seed: Seed = 0,
    out: Path | None = None,
    resume: bool = False,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Identify a model's parameters: every plausible solution, its exact minimum and its uncertainty.

    Example: mofit identify my_campaign.nc --all-freqs --model maxwell_tyre --seed 1

    Parameters
    ----------
    file
        Campaign file; without one the bundled (simulated) campaign is taken.
    all_freqs
        Use all tests whose excitation the model is made for; the default without --freq and --test.
    freq
        Use only the tests of this frequency in Hz; repeatable.
    weights
        Weight of a test in the search, TEST=NUMBER; repeatable.
    out
        Folder of the run. By default the next free one under runs/.
    resume
        Resume an interrupted run.
    """
    from mofit.cli.output import progress_bar
    from mofit.identification.settings import Settings
    from mofit.workflows.jobs import Job, identify_file

    if all_freqs and (freq or test):
        raise InputError.of("--all-freqs", "given together with --freq or --test", "Leave one of them out")
    settings = Settings(
        search=search,
        weights=by_name("--weights", weights),
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        joint=joint,
        seed=seed,
        jobs=cores(jobs),
    )
    job = Job(file, model, effect, freq, test, settings, out, resume)
    with progress_bar() as progress:
        folder, summary = identify_file(job, progress)
    if as_json:
        print_json(summary)
    else:
        from mofit.cli.output import show_identification

        show_identification(summary, folder)
    return DONE if summary["converged"] else NOT_CONVERGED


@app.command
def report(run: Path, /, *, as_json: Json = False) -> int:
    """Rebuild the HTML report of a run.

    Example: mofit report runs/my-campaign-maxwell_tyre

    Parameters
    ----------
    run
        Folder of a finished run.
    """
    from mofit.report import build_report

    page = build_report(run)
    if as_json:
        print_json({"report": str(page)})
    else:
        print(page)
    return DONE


@app.command
def uncertainty(run: Path, /, *, parameter: tuple[str, ...] = (), as_json: Json = False) -> int:
    """Build the uncertainty page of a run: intervals, correlations, predictive bands, homogeneity of the tests.

    Example: mofit uncertainty runs/my-campaign-maxwell_tyre --parameter d_M

    Parameters
    ----------
    run
        Folder of a finished run.
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
        print_json({"uncertainty": str(page), **table})
    else:
        print(page)
    if not table["converged"]:
        return NOT_CONVERGED
    return NOT_IDENTIFIABLE if table["not_identifiable"] else DONE
