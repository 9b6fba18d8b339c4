"""Commands before anything is measured: compare experiments, and design the next tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from mofit.cli.app import (
    DONE,
    NOT_IDENTIFIABLE,
    Dask,
    Effects,
    Force,
    Jobs,
    Json,
    Seed,
    Simulations,
    TimeLimit,
    Timeout,
    app,
    by_name,
    cores,
    print_json,
    seconds,
    tests_by_name,
)
from mofit.cli.time_limit import time_limit as ended_in
from mofit.errors import Issue, raise_errors

ModelName = Annotated[
    str | None,
    Parameter(help="Name of a shipped model, or path/to/file.py:Name. By default the plan's, or the channels decide."),
]
At = Annotated[tuple[str, ...], Parameter(help="Reference value of a parameter, NAME=VALUE in SI units; repeatable.")]
FromRun = Annotated[
    Path | None,
    Parameter(
        help="Folder of a run whose posterior gives the parameter samples. "
        "By default they are drawn from a box around the reference values."
    ),
]
Samples = Annotated[int, Parameter(help="Number of parameter samples.")]
Page = Annotated[Path | None, Parameter(help="HTML page to write.")]


@contextmanager
def _files(outputs: Mapping[str, Path | None], force: bool, inputs: Sequence[Path]) -> Iterator[None]:
    """Claim the files that the options name, all before the work."""
    from mofit.runtime.output_file import output_file

    named = {option: path for option, path in outputs.items() if path is not None}
    with ExitStack() as claims:
        raise_errors(
            Issue(f"{option} {path}", "two outputs have this name", "Name another file")
            for option, path in list(named.items())[1:]
            if path.absolute() == next(iter(named.values())).absolute()
        )
        for option, path in named.items():
            claims.enter_context(output_file(path, option, force=force, inputs=inputs))
        yield


@app.command
def compare(
    *files: Path,
    model: ModelName = None,
    effect: Effects = (),
    parameter: tuple[str, ...] = (),
    group: tuple[str, ...] = (),
    at: At = (),
    run: FromRun = None,
    samples: Samples = 16,
    posterior: int = 0,
    out: Page = None,
    force: Force = False,
    simulations: Simulations = None,
    timeout: Timeout = None,
    dask: Dask = None,
    time_limit: TimeLimit = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Compare experiments before anything is measured: the expected uncertainty of each parameter, and why.

    Example: mofit compare data/plans/paper.toml --parameter d_M --out compare.html

    Parameters
    ----------
    files
        Campaigns, or plans of `mofit simulate`. One file: each test, and all together.
        Several: file against file.
    parameter
        Parameter to compare by: exit code 4 if no experiment identifies it; repeatable. By default all that no
        calibration stage estimates.
    group
        An experiment of some tests, NAME=TEST,TEST; repeatable.
    posterior
        Number of experiments, the best first, whose simulated data are identified; shows the width of the posterior.
    """
    from mofit.cli.output import progress_bar, show_comparison
    from mofit.experimental_design.summary import comparison_summary
    from mofit.experimental_design.text import augmentation_sentences
    from mofit.workflows.planning import compare as compared

    values, groups, threads = by_name("--at", at), tests_by_name("--group", group), cores(jobs)
    with _files({"--out": out}, force, files):
        with progress_bar() as progress, ended_in(time_limit):
            found = compared(
                *files, model=model, effects=effect, parameters=parameter, groups=groups, at=values, run=run,
                samples=samples, posterior=posterior, seed=seed, jobs=threads, simulations=simulations,
                timeout=seconds("--timeout", timeout), dask=dask, progress=progress,
            )  # fmt: skip
        summary = comparison_summary(found)
        if out is not None:
            from mofit.experimental_design.pages.comparison import write_comparison

            summary["page"] = str(write_comparison(found, out))
    if as_json:
        print_json(summary)
    else:
        show_comparison(summary, augmentation_sentences(found))
    return NOT_IDENTIFIABLE if found.not_identifiable else DONE


@app.command
def design(
    *files: Path,
    space: Path | None = None,
    model: ModelName = None,
    effect: Effects = (),
    parameter: tuple[str, ...] = (),
    criterion: str | None = None,
    combination: tuple[str, ...] = (),
    discriminate: tuple[str, ...] = (),
    budget: str | None = None,
    robust: str = "mean",
    ignore_existing_tests: bool = False,
    target: tuple[str, ...] = (),
    at: At = (),
    run: FromRun = None,
    samples: Samples = 8,
    plan: Path | None = None,
    out: Page = None,
    force: Force = False,
    simulations: Simulations = None,
    timeout: Timeout = None,
    dask: Dask = None,
    time_limit: TimeLimit = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Find the next tests: the most informative on parameters, or between effects, in the time there is.

    Example: mofit design data/plans/paper.toml --parameter d_M --budget "109 s" --out design.html --plan next.toml

    Parameters
    ----------
    files
        Campaign, or plan of `mofit simulate`: the tests that exist, or are planned anyway. Several campaigns count as
        one; with the --run that identified them --over conditions, the design says under which to measure next.
    space
        Design space (TOML): candidate tests and the limits of the rig; see docs/design.md. By default the range that
        the tests of FILE cover.
    parameter
        Parameter to estimate: exit code 4 if it stays not identifiable; repeatable. By default all that no
        calibration stage estimates.
    criterion
        c (one parameter, or a combination), D (all together), A (mean variance) or E (worst direction).
    combination
        Weight of a parameter's relative change, NAME=WEIGHT; repeatable. d_M=1 and c_M=-1 give the ratio of the two.
    discriminate
        Effect to discriminate: one from no effect, two from each other; repeatable.
    budget
        Time available with overheads, for example "120 s". By default that of the longest test of FILE.
    robust
        What counts over the parameter samples: mean (of the criterion's logarithm) or worst.
    ignore_existing_tests
        Start from the calibration stages alone, as if FILE had no other tests.
    target
        Condition under which the parameters are to be known, NAME=VALUE in SI units; repeatable. Of a --run whose
        parameters follow laws; conditions that are not named are in the middle of their ranges.
    plan
        Plan file to write the design into, for `mofit simulate`.
    """
    from mofit.cli.output import progress_bar, show_design
    from mofit.experimental_design.summary import design_summary
    from mofit.workflows.planning import design as designed

    values, weights, aim = (
        by_name(*one) for one in (("--at", at), ("--combination", combination), ("--target", target))
    )
    threads = cores(jobs)
    with _files({"--plan": plan, "--out": out}, force, [*files, *([space] if space else [])]):
        with progress_bar() as progress, ended_in(time_limit):
            proposal = designed(
                files, space=space, model=model, effects=effect, parameters=parameter, criterion=criterion,
                combination=weights, discriminate=discriminate, budget=budget, robust=robust,
                ignore_existing_tests=ignore_existing_tests, target=aim, at=values, run=run, samples=samples,
                seed=seed, jobs=threads, simulations=simulations, timeout=seconds("--timeout", timeout), dask=dask,
                progress=progress,
            )  # fmt: skip
        summary = design_summary(proposal)
        if plan is not None:
            from mofit.experimental_design.design_job import write_plan

            write_plan(proposal, plan)
        if out is not None:
            from mofit.experimental_design.pages.design import write_design_page

            write_design_page(proposal, summary, out)
    if as_json:
        print_json(summary)
    else:
        show_design(summary)
    return NOT_IDENTIFIABLE if summary["not_identifiable"] else DONE
