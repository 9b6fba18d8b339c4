"""Commands that estimate: identify, diagnose, and batch for many campaigns."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import (
    DONE,
    NOT_CONVERGED,
    UNUSABLE,
    Bounds,
    Dask,
    Effects,
    Evaluations,
    Fixed,
    Free,
    Jobs,
    Joint,
    Json,
    Laws,
    MapFile,
    ModelName,
    Over,
    Search,
    Seed,
    SetPoints,
    Simulations,
    Tests,
    TimeLimit,
    Timeout,
    app,
    by_name,
    cores,
    names,
    print_json,
    range_by_name,
    seconds,
    text_by_name,
)
from mofit.cli.time_limit import LATE
from mofit.cli.time_limit import time_limit as ended_in
from mofit.errors import InputError


@app.command
def identify(
    *files: Path,
    all_freqs: bool = False,
    freq: tuple[float, ...] = (),
    test: Tests = (),
    hold_out: tuple[str, ...] = (),
    model: ModelName = None,
    map_file: MapFile = None,
    free: Free = (),
    effect: Effects = (),
    search: Search = None,
    evaluations: Evaluations = None,
    simulations: Simulations = None,
    weights: tuple[str, ...] = (),
    bounds: Bounds = (),
    fix: Fixed = (),
    per_test: tuple[str, ...] = (),
    per: tuple[str, ...] = (),
    pooled: tuple[str, ...] = (),
    over: Over = (),
    law: Laws = (),
    set_point: SetPoints = (),
    joint: Joint = False,
    seed: Seed = 0,
    out: Path | None = None,
    resume: bool = False,
    no_sample: bool = False,
    timeout: Timeout = None,
    dask: Dask = None,
    time_limit: TimeLimit = None,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Identify a model's parameters: every plausible solution, its exact minimum and its uncertainty.

    Example: mofit identify my_campaign.nc --all-freqs --model maxwell_tyre --seed 1

    Parameters
    ----------
    files
        Campaign file, or several, whose tests are identified together; with --over the parameters follow the conditions
        in which the files differ. By default the bundled (simulated) campaign.
    all_freqs
        Use all tests whose excitation the model is made for; the default without --freq and --test.
    freq
        Use only the tests of this frequency in Hz; repeatable.
    hold_out
        Do not use the test of this name; it is predicted afterwards, and the report tells how well; repeatable.
        CONDITION=NUMBER, in SI units, names all tests of a condition.
    weights
        Weight of a test in the search, TEST=NUMBER; repeatable. Of several outputs "TEST / OUTPUT=NUMBER" names one.
    per_test
        Parameter that has a value of its own in every test (an offset, an initial state); repeatable.
    per
        Parameter that has one value per value of a condition, PARAMETER=CONDITION; repeatable.
    pooled
        Like --per-test or --per, its values drawn from a normal whose mean and spread are estimated; repeatable.
    out
        Folder of the run. By default the next free one under runs/.
    resume
        Resume an interrupted run of the same settings; without one, start.
    no_sample
        Skip the sampling: estimates with the standard deviations of the Laplace approximation; exit code 3.
    """
    from mofit.cli.output import progress_bar, show_identification
    from mofit.identification.settings import Settings
    from mofit.models.fmu import fmu_reference
    from mofit.parameters import PER_TEST
    from mofit.results import summary as run_summary
    from mofit.simulation.evaluation.executors import TIMEOUT
    from mofit.workflows.api import identify as identified

    if all_freqs and (freq or test):
        raise InputError.of("--all-freqs", "given together with --freq or --test", "Leave one of them out")
    settings = Settings(
        search=search,
        evaluations=evaluations,
        simulations=simulations,
        timeout=seconds("--timeout", timeout) or TIMEOUT,
        dask=dask,
        weights=by_name("--weights", weights),
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        scopes=dict.fromkeys(per_test, PER_TEST) | text_by_name("--per", per),
        pooled=pooled,
        over=names(over),
        laws=text_by_name("--law", law),
        set_points=by_name("--set-point", set_point),
        joint=joint,
        seed=seed,
        jobs=cores(jobs),
        sample=not no_sample,
        time_limit=seconds("--time-limit", time_limit),
    )
    with progress_bar() as progress, ended_in(time_limit, LATE):
        named = fmu_reference(model, map_file, free)
        folder, tree = identified(
            files, named, settings, effects=effect, tests=test, frequencies=freq, hold_out=hold_out, out=out,
            resume=resume, progress=progress,
        )  # fmt: skip
        summary = run_summary(tree, folder)
    if as_json:
        print_json(summary)
    else:
        show_identification(summary, folder)
    return DONE if summary["trusted"] else NOT_CONVERGED


@app.command
def diagnose(
    *files: Path,
    model: ModelName = None,
    map_file: MapFile = None,
    free: Free = (),
    effects: tuple[str, ...] = (),
    include: tuple[str, ...] = (),
    test: Tests = (),
    hold_out: tuple[str, ...] = (),
    bounds: Bounds = (),
    fix: Fixed = (),
    per_test: tuple[str, ...] = (),
    per: tuple[str, ...] = (),
    over: Over = (),
    law: Laws = (),
    set_point: SetPoints = (),
    seed: Seed = 0,
    out: Path | None = None,
    simulations: Simulations = None,
    timeout: Timeout = None,
    dask: Dask = None,
    time_limit: TimeLimit = None,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Diagnose the gap between a campaign and a model: where it lies, which effect causes it, how far it shrinks.

    Example: mofit diagnose my_campaign.nc --model maxwell_tyre --effects my_effect.py

    Parameters
    ----------
    files
        Campaign file, or several, whose tests are looked at together. By default the bundled (simulated) campaign.
    effects
        Candidate effect; repeatable. A shipped name: only those named are tried. path/to/file.py:Name: it is tried
        beside the others. By default all shipped effects that the model admits.
    include
        Effect that is part of the model, as start:STATE for an initial state; repeatable.
    hold_out
        Do not use the test of this name; it is predicted once all is done, and how far the gap shrinks is measured on
        it; repeatable.
    per_test
        Parameter of the model or of an effect that has a value of its own in every test (an offset, an initial state,
        a delay of the clock): it is estimated along; repeatable.
    per
        Parameter that has one value per value of a condition, PARAMETER=CONDITION; repeatable.
    out
        Folder for diagnosis.html and diagnosis.json. By default the next free one under runs/.
    """
    from mofit.diagnosis.page_beside import reader_beside

    with reader_beside(files) as (read, drawn):  # while this process imports
        from mofit.cli.diagnosis_shown import show_diagnosis
        from mofit.cli.output import progress_bar
        from mofit.identification.settings import Settings
        from mofit.models.fmu import fmu_reference
        from mofit.parameters import PER_TEST
        from mofit.simulation.evaluation.executors import TIMEOUT
        from mofit.workflows.jobs import Job, diagnose_file

        settings = Settings(
            simulations=simulations,
            timeout=seconds("--timeout", timeout) or TIMEOUT,
            dask=dask,
            bounds=range_by_name("--bounds", bounds),
            fixed=by_name("--fix", fix),
            scopes=dict.fromkeys(per_test, PER_TEST) | text_by_name("--per", per),
            over=names(over),
            laws=text_by_name("--law", law),
            set_points=by_name("--set-point", set_point),
            seed=seed,
            jobs=cores(jobs),
        )
        named = fmu_reference(model, map_file, free)
        with progress_bar() as progress, ended_in(time_limit):
            job = Job(read(), named, effects, (), test, settings, out, hold_out=hold_out, included=include)
            folder, found = diagnose_file(job, drawn, progress)
    if as_json:
        print_json({**found, "folder": str(folder)})
    else:
        show_diagnosis(found, folder)
    return DONE if found["complete"] else NOT_CONVERGED


@app.command
def batch(
    *places: Path,
    what: str = "identify",
    model: ModelName = None,
    effect: tuple[str, ...] = (),
    search: Search = None,
    bounds: Bounds = (),
    fix: Fixed = (),
    joint: Joint = False,
    seed: Seed = 0,
    out: Path = Path("runs/batch"),
    time_limit: TimeLimit = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    as_json: Json = False,
) -> int:
    """Identify or diagnose every campaign of some folders; called again, it resumes.

    Example: mofit batch campaigns/ --out runs/loads --jobs 2

    Parameters
    ----------
    places
        Campaign files, or folders of campaign files (.nc, .h5, .hdf5).
    what
        What to do with each campaign: identify or diagnose.
    effect
        Effect to add to the model, or (diagnose) candidate: a shipped name, or path/to/file.py:Name; repeatable.
    out
        Folder for the runs, table.csv and batch.html.
    jobs
        Processes on this machine, one campaign each. By default one per core.
    scheduler
        Address of a Dask scheduler, tcp://host:port. Its workers replace the processes; they must see the same files.
    """
    from mofit.cli.output import progress_bar
    from mofit.identification.settings import Settings
    from mofit.workflows.api import batch as run_all

    settings = Settings(
        search=search, bounds=range_by_name("--bounds", bounds), fixed=by_name("--fix", fix), joint=joint, seed=seed
    )
    processes = cores(jobs)
    with progress_bar() as progress, ended_in(time_limit):
        rows = run_all(
            *places, out=out, what=what, model=model, effects=effect, settings=settings, jobs=processes,
            scheduler=scheduler, progress=progress,
        )  # fmt: skip
    states = [row.state for row in rows]
    if as_json:
        campaigns = [{"name": row.name, "state": row.state, "message": row.message, **row.summary} for row in rows]
        print_json({"schema": "mofit.batch/1", "out": str(out), "campaigns": campaigns})
    else:
        for row in rows:
            print(f"{row.name}: {row.state}{f' ({row.message})' if row.message else ''}")
        print(f"{states.count('done')} of {len(rows)} done; page: {out / 'batch.html'}")
    if "failed" in states:
        return UNUSABLE
    return NOT_CONVERGED if "not converged" in states else DONE
