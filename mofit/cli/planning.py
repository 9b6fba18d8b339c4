"""Commands on what to test: compare."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path

from mofit.cli.app import DONE, NOT_IDENTIFIABLE, Jobs, Json, app, print_json


@app.command
def compare(
    *files: Path,
    model: str | None = None,
    effect: tuple[str, ...] = (),
    parameter: tuple[str, ...] = (),
    group: tuple[str, ...] = (),
    at: tuple[str, ...] = (),
    run: Path | None = None,
    points: int = 16,
    posterior: int = 0,
    out: Path | None = None,
    seed: int = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Compare test procedures: what each can tell of each parameter, before anything is measured.

    Example: mofit compare data/plans/paper.toml --parameter d_M --out compare.html

    Parameters
    ----------
    files
        Campaigns, or plans of `mofit simulate`. One file: every test alone, and all; several: file against file.
    model
        Name of a shipped model, or path/to/file.py:Name; by default the plan's, or found from the channels.
    effect
        Effect to add to the model: a shipped name, or path/to/file.py:Name; repeatable.
    parameter
        Ask for this parameter: exit code 4 if no procedure identifies it; repeatable.
    group
        A procedure of some tests, NAME=TEST,TEST; repeatable.
    at
        Value of a parameter that verdicts are asked at, NAME=VALUE in SI units; repeatable.
    run
        Folder of a run, over whose posterior verdicts are asked, instead of a box around the values.
    points
        Parameter sets that verdicts are asked at.
    posterior
        Identify simulated data of so many of the procedures, the best first, and show the posterior's width.
    out
        Page to write.
    seed
        Seed of every random draw.
    """
    from mofit.identifiability.compare_files import CompareJob, compare_files, mend_sentence, parse_groups, summary
    from mofit.library import find_effect, find_model
    from mofit.model import with_effects
    from mofit.options import by_name
    from mofit.simulate import Plan
    from mofit.terminal import progress_bar

    def choose(what):  # type: ignore[no-untyped-def]
        if model is not None:
            found = find_model(model)
        elif isinstance(what, Plan):
            found = find_model(what.model)
        else:
            from mofit.job import model_for

            found = model_for(what)
        return with_effects(found, *(find_effect(name) for name in effect))

    job = CompareJob(
        files=files,
        parameters=parameter,
        groups=parse_groups(group),
        at=by_name("--at", at),
        run=run,
        points=points,
        seed=seed,
        jobs=jobs or os.cpu_count() or 1,
    )
    with progress_bar() as progress:
        comparison, mends = compare_files(job, choose, progress)
        found = {}
        if posterior:
            from mofit.identifiability.posterior import confirm_by_posterior

            found = confirm_by_posterior(comparison, posterior, seed, job.jobs, progress)
    told = summary(comparison, mends)
    if found:
        told["posterior"] = {
            procedure: {name: asdict(own) for name, own in parameters.items()}
            for procedure, parameters in found.items()
        }
    sentences = [mend_sentence(name, mend, comparison) for name, mend in mends.items()]
    if out is not None:
        from mofit.identifiability.compare_page import write_comparison

        told["page"] = str(write_comparison(comparison, sentences, out))
    if as_json:
        print_json(told)
    else:
        from mofit.cli.comparison_table import show_comparison

        show_comparison(told, sentences)
    return NOT_IDENTIFIABLE if comparison.lost else DONE
