"""Commands on runs: identify, report, uncertainty."""

from __future__ import annotations

import os
from pathlib import Path

from mofit.cli.app import DONE, NOT_CONVERGED, NOT_IDENTIFIABLE, Jobs, Json, app, print_json
from mofit.errors import InputError


@app.command
def identify(
    file: Path | None = None,
    /,
    *,
    all_freqs: bool = False,
    freq: tuple[float, ...] = (),
    test: tuple[str, ...] = (),
    model: str | None = None,
    effect: tuple[str, ...] = (),
    search: str = "niching",
    weights: tuple[str, ...] = (),
    bounds: tuple[str, ...] = (),
    fix: tuple[str, ...] = (),
    joint: bool = False,
    seed: int = 0,
    out: Path | None = None,
    resume: bool = False,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Identify a model's parameters: every plausible solution, its exact minimum and its spread.

    Example: mofit identify my_campaign.nc --all-freqs --model maxwell_tyre --seed 1

    Parameters
    ----------
    file
        Campaign file; without one the bundled (simulated) campaign is taken.
    all_freqs
        Use all tests of the model's kinds; the default unless --freq is given.
    freq
        Use only the tests of this frequency in Hz, as on their label; repeatable.
    test
        Use only the test of this name; repeatable.
    model
        Name of a shipped model, or path/to/file.py:Name. Found from the channels if left out.
    effect
        Effect to add to the model: a shipped name, or path/to/file.py:Name; repeatable.
    search
        niching (the default), paper (the firefly algorithm exactly as published) or surrogate (for expensive models).
    weights
        Weight of a test in the search, TEST=NUMBER; repeatable.
    bounds
        Other bounds for a parameter, NAME=LOWER:UPPER in SI units; repeatable.
    fix
        Hold a parameter, NAME=VALUE in SI units; repeatable.
    joint
        Identify calibration and dynamic parameters at once.
    seed
        Seed of every random draw.
    out
        Folder of the run; by default the next free one under runs/.
    resume
        Go on with an interrupted run.
    """
    from mofit.job import Job, identify_file
    from mofit.options import by_name, range_by_name
    from mofit.settings import Settings
    from mofit.terminal import progress_bar

    if all_freqs and (freq or test):
        raise InputError.of("--all-freqs", "given together with --freq or --test", "Leave one of them out")
    settings = Settings(
        search=search,
        weights=by_name("--weights", weights),
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        joint=joint,
        seed=seed,
        jobs=jobs or os.cpu_count() or 1,
    )
    job = Job(file, model, effect, freq, test, settings, out, resume)
    with progress_bar() as progress:
        folder, summary = identify_file(job, progress)
    if as_json:
        print_json(summary)
    else:
        from mofit.terminal import show_identification

        show_identification(summary, folder)
    return DONE if summary["converged"] else NOT_CONVERGED


@app.command
def report(run: Path, /, *, as_json: Json = False) -> int:
    """Build the HTML report of a run anew.

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
    """Build the uncertainty page of a run: intervals, flat directions, predictive bands, agreement of the tests.

    Example: mofit uncertainty runs/my-campaign-maxwell_tyre --parameter d_M

    Parameters
    ----------
    run
        Folder of a finished run.
    parameter
        Ask for this parameter: exit code 4 if the data do not identify it; repeatable.
    """
    from mofit.report import build_uncertainty, spread_table
    from mofit.result import open_result

    tree = open_result(run)
    table = spread_table(tree, parameter)
    page = build_uncertainty(run, tree)
    if as_json:
        print_json({"uncertainty": str(page), **table})
    else:
        print(page)
    if not table["converged"]:
        return NOT_CONVERGED
    return NOT_IDENTIFIABLE if table["not_identifiable"] else DONE
