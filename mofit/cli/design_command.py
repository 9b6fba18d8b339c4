"""The command that finds the next test."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from mofit.cli.app import DONE, NOT_IDENTIFIABLE, Jobs, Json, app, print_json
from mofit.errors import InputError

if TYPE_CHECKING:
    from mofit.campaign import Campaign
    from mofit.model import Model
    from mofit.simulate import Plan


@app.command
def design(
    file: Path,
    /,
    *,
    space: Path | None = None,
    model: str | None = None,
    effect: tuple[str, ...] = (),
    parameter: tuple[str, ...] = (),
    criterion: str | None = None,
    combination: tuple[str, ...] = (),
    separate: tuple[str, ...] = (),
    budget: str | None = None,
    robust: str = "mean",
    fresh: bool = False,
    at: tuple[str, ...] = (),
    run: Path | None = None,
    points: int = 8,
    plan: Path | None = None,
    out: Path | None = None,
    seed: int = 0,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Find the next tests: those that tell most of the parameters, or tell effects apart, in the time there is.

    Example: mofit design data/plans/paper.toml --parameter d_M --budget "109 s" --out design.html --plan next.toml

    Parameters
    ----------
    file
        Campaign, or plan of `mofit simulate`: the tests that there are or will be anyway.
    space
        Space file (TOML): which tests the rig could run, and its limits; see docs/design.md. Without one, tests within
        what those of FILE show that the rig can do.
    model
        Name of a shipped model, or path/to/file.py:Name; by default the plan's, or found from the channels.
    effect
        Effect that belongs to the model: a shipped name, or path/to/file.py:Name; repeatable.
    parameter
        What is to be learnt: exit code 4 if it stays not identifiable; repeatable. By default all that no calibration
        stage knows.
    criterion
        c (one parameter, or a combination), D (all together), A (mean variance) or E (worst direction).
    combination
        Weight of a relative change, NAME=WEIGHT, repeatable: d_M=1 c_M=-1 is the ratio of the two.
    separate
        Effect to be told apart, from a second one or (alone) from nothing; repeatable.
    budget
        Time there is, overheads included, "120 s"; by default that of the longest test of FILE.
    robust
        Over the parameter sets: mean of the logarithm, or worst.
    fresh
        Start from the calibration stages alone, as if the other tests of FILE were not there.
    at
        Value of a parameter that the design is made for, NAME=VALUE in SI units; repeatable.
    run
        Folder of a run, over whose posterior the design is made, instead of a box around the values.
    points
        Parameter sets that it is made for.
    plan
        Plan file to write the programme into, for `mofit simulate`.
    out
        Page to write.
    seed
        Seed of every random draw.
    """
    from mofit.identifiability.design_files import DesignJob, design_file
    from mofit.identifiability.design_summary import summary
    from mofit.library import find_effect
    from mofit.options import by_name
    from mofit.terminal import progress_bar

    if plan is not None and plan.exists():
        raise InputError.of(f"--plan {plan}", "exists already", "Name another, or remove it")
    for option, target in (("--plan", plan), ("--out", out)):
        if target is not None and not target.parent.is_dir():
            raise InputError.of(f"{option} {target}", "its folder does not exist", "Make the folder first")
    rivals = tuple(find_effect(name) for name in separate)
    job = DesignJob(
        file=file,
        space=space,
        parameters=parameter,
        criterion=criterion,
        combination=by_name("--combination", combination),
        rivals=rivals,
        budget=budget,
        robust=robust,
        at=by_name("--at", at),
        run=run,
        points=points,
        fresh=fresh,
        seed=seed,
        jobs=jobs or os.cpu_count() or 1,
    )

    def choose(what: Plan | Campaign) -> Model:
        from mofit.model import with_effects

        return with_effects(_base(what, model), *(find_effect(name) for name in effect), *rivals)

    with progress_bar() as progress:
        proposal = design_file(job, choose, lambda what: model or _base(what, None).name, progress)
    told = summary(proposal, job)
    if plan is not None:
        from mofit.simulate.plan_text import plan_text

        plan.write_text(plan_text(proposal.plan, f"Proposed by mofit design {file.name}."), encoding="utf-8")
    if out is not None:
        from mofit.identifiability.design_page import write_design_page

        write_design_page(proposal, told, out)
    if as_json:
        print_json(told)
    else:
        from mofit.cli.design_table import show_design

        show_design(told)
    return NOT_IDENTIFIABLE if told["lost"] else DONE


def _base(what: Plan | Campaign, model: str | None) -> Model:
    """The model without effects."""
    from mofit.job import model_for
    from mofit.library import find_model
    from mofit.simulate import Plan

    if model is not None:
        return find_model(model)
    return find_model(what.model) if isinstance(what, Plan) else model_for(what)
