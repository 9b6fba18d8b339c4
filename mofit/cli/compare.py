"""The command that compares experiments."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, NOT_IDENTIFIABLE, app, print_json
from mofit.cli.options import Effects, Jobs, Json, Seed, by_name, cores, tests_by_name


@app.command
def compare(
    *files: Path,
    model: str | None = None,
    effect: Effects = (),
    parameter: tuple[str, ...] = (),
    group: tuple[str, ...] = (),
    at: tuple[str, ...] = (),
    run: Path | None = None,
    samples: int = 16,
    posterior: int = 0,
    out: Path | None = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Compare experiments before anything is measured: the expected uncertainty of each parameter, and why.

    Example: mofit compare data/plans/paper.toml --parameter d_M --out compare.html

    Parameters
    ----------
    files
        Campaigns, or plans of `mofit simulate`. One file: every test alone, and all; several: file against file.
    model
        Name of a shipped model, or path/to/file.py:Name. By default the plan's, or the channels decide.
    parameter
        Required parameter: exit code 4 if no experiment identifies it; repeatable.
    group
        An experiment of some tests, NAME=TEST,TEST; repeatable.
    at
        Reference value of a parameter, NAME=VALUE in SI units; repeatable.
    run
        Folder of a run: its posterior gives the parameter samples, instead of a box around the reference values.
    samples
        Number of parameter samples.
    posterior
        Identify simulated data of so many experiments, the best first, and show the posterior's width.
    out
        Page to write.
    """
    from mofit.cli.output import progress_bar, show_comparison
    from mofit.design.comparison import compare_files
    from mofit.design.prepare import Inputs
    from mofit.design.summary import comparison_summary
    from mofit.design.text import augmentation_sentences

    inputs = Inputs(files, model, effect, by_name("--at", at), run, samples, seed, cores(jobs))
    with progress_bar() as progress:
        found = compare_files(inputs, parameter, tests_by_name("--group", group), posterior, progress)
    summary = comparison_summary(found)
    if out is not None:
        from mofit.design.pages.comparison import write_comparison

        summary["page"] = str(write_comparison(found, out))
    if as_json:
        print_json(summary)
    else:
        show_comparison(summary, augmentation_sentences(found))
    return NOT_IDENTIFIABLE if found.not_identifiable else DONE
