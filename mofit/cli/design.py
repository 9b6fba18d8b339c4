"""The command that finds the next tests."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, NOT_IDENTIFIABLE, app, print_json
from mofit.cli.options import Effects, Jobs, Json, Seed, by_name, cores
from mofit.errors import InputError


@app.command
def design(
    file: Path,
    /,
    *,
    space: Path | None = None,
    model: str | None = None,
    effect: Effects = (),
    parameter: tuple[str, ...] = (),
    criterion: str | None = None,
    combination: tuple[str, ...] = (),
    discriminate: tuple[str, ...] = (),
    budget: str | None = None,
    robust: str = "mean",
    ignore_existing_tests: bool = False,
    at: tuple[str, ...] = (),
    run: Path | None = None,
    samples: int = 8,
    plan: Path | None = None,
    out: Path | None = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Find the next tests: the most informative on parameters, or between effects, in the time there is.

    Example: mofit design data/plans/paper.toml --parameter d_M --budget "109 s" --out design.html --plan next.toml

    Parameters
    ----------
    file
        Campaign, or plan of `mofit simulate`: the tests that there are or will be anyway.
    space
        Design space (TOML): candidate tests and the limits of the rig; see docs/design.md. By default tests within
        what those of FILE demonstrate.
    model
        Name of a shipped model, or path/to/file.py:Name. By default the plan's, or the channels decide.
    parameter
        Parameter to be learnt: exit code 4 if it stays not identifiable; repeatable. By default all that no
        calibration stage estimates.
    criterion
        c (one parameter, or a combination), D (all together), A (mean variance) or E (worst direction).
    combination
        Weight of a relative change, NAME=WEIGHT, repeatable: d_M=1 c_M=-1 is the ratio of the two.
    discriminate
        Effect to be discriminated from a second one or (alone) from none; repeatable.
    budget
        Time there is, overheads included, "120 s"; by default that of the longest test of FILE.
    robust
        Over the parameter samples: mean of the logarithm, or worst.
    ignore_existing_tests
        Start from the calibration stages alone, as if FILE had no other tests.
    at
        Reference value of a parameter, NAME=VALUE in SI units; repeatable.
    run
        Folder of a run: its posterior gives the parameter samples, instead of a box around the reference values.
    samples
        Number of parameter samples.
    plan
        Plan file to write the design into, for `mofit simulate`.
    out
        Page to write.
    """
    from mofit.cli.output import progress_bar, show_design
    from mofit.design.design_job import DesignJob, design_file
    from mofit.design.prepare import Inputs
    from mofit.design.summary import design_summary

    if plan is not None and plan.exists():
        raise InputError.of(f"--plan {plan}", "exists already", "Name another, or remove it")
    for option, target in (("--plan", plan), ("--out", out)):
        if target is not None and not target.parent.is_dir():
            raise InputError.of(f"{option} {target}", "its folder does not exist", "Make the folder first")
    job = DesignJob(
        inputs=Inputs((file,), model, effect, by_name("--at", at), run, samples, seed, cores(jobs)),
        space=space,
        parameters=parameter,
        criterion=criterion,
        combination=by_name("--combination", combination),
        discriminate=discriminate,
        budget=budget,
        robust=robust,
        ignore_existing=ignore_existing_tests,
    )
    with progress_bar() as progress:
        proposal = design_file(job, progress)
    summary = design_summary(proposal)
    if plan is not None:
        from mofit.simulation.virtual_rig.plan import plan_text

        plan.write_text(plan_text(proposal.plan, f"Proposed by mofit design {file.name}."), encoding="utf-8")
    if out is not None:
        from mofit.design.pages.design import write_design_page

        write_design_page(proposal, summary, out)
    if as_json:
        print_json(summary)
    else:
        show_design(summary)
    return NOT_IDENTIFIABLE if summary["not_identifiable"] else DONE
