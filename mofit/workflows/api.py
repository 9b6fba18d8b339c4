"""What the commands do, as functions of the same names and words: ``mofit.identify``, ``mofit.diagnose`` and so on.

A campaign, a plan or a run may be an object or a path; a model or an effect an object or a name. Where no listener is
given, a notebook shows the progress.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from mofit.data import Campaign
from mofit.diagnosis.page_beside import page_beside
from mofit.identification.inputs import as_campaign, as_effects, as_names
from mofit.identification.settings import Settings
from mofit.models import Effect, Model
from mofit.results import open_result
from mofit.runtime.notebook import listener
from mofit.runtime.progress import Progress
from mofit.workflows.jobs import Campaigns, Job, diagnosed, identified
from mofit.workflows.shown import Result

if TYPE_CHECKING:
    from mofit.diagnosis.result import Diagnosis
    from mofit.workflows.batch_tasks import Row

#: one effect or several, or their names
Effects = Effect | str | Sequence[Effect | str]


def open_run(run: str | Path) -> Result:
    """The result of a finished run, by its folder or its ``result.nc``.

    Raises
    ------
    InputError
        If there is no such run.
    """
    return Result.of(open_result(run))


def identify(
    campaign: Campaigns = (),
    model: Model | str | None = None,
    settings: Settings | None = None,
    *,
    effects: Effects = (),
    tests: str | Sequence[str] = (),
    frequencies: Sequence[float] = (),
    hold_out: str | Sequence[str] = (),
    out: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> tuple[Path, Result]:
    """Identify a model's parameters: every plausible solution, its exact minimum and its uncertainty.

    Parameters
    ----------
    campaign
        The measurements, or the path of their file; the tests of several are identified together, each under the
        conditions of its own. By default the bundled campaign, which is simulated.
    model
        The model, or its name: a shipped one's, or ``path/to/file.py:Name``. By default the channels decide.
    settings
        Settings of the identification: bounds, scopes, search, seed and others.
    effects
        Effects to add to the model.
    tests, frequencies
        Names and frequencies (Hz) of the tests to use; by default all whose excitation the model is made for.
    hold_out
        Name or names of tests that are not used at all, but predicted afterwards: group ``held_out`` of the result.
    out
        Folder of the run; by default the next free one under ``runs/``.
    resume
        Take up an interrupted run with the same settings, if there is one.
    progress
        Called as ``progress(stage, done, total, note)``.

    Returns
    -------
    folder
        The run's folder, with ``result.nc``, ``chains.h5`` and ``report.html``.
    tree
        The result: an xarray tree that a notebook shows as table and figures. `mofit.summary` makes a data frame of it.

    Raises
    ------
    InputError
        If campaign, model and settings don't fit together, or the folder can't be had; nothing is written then.
    WriteError
        If the disk fills up; what was written before stays, and ``resume`` goes on.
    """
    job = Job(
        campaign, model, as_effects(effects), tuple(frequencies), as_names(tests), settings or Settings(),
        None if out is None else Path(out), resume, as_names(hold_out),
    )  # fmt: skip
    folder, tree = identified(job, listener(progress))
    return folder, Result.of(tree)


def diagnose(
    campaign: Campaigns = (),
    model: Model | str | None = None,
    effects: Effects = (),
    settings: Settings | None = None,
    *,
    include: Effects = (),
    tests: str | Sequence[str] = (),
    hold_out: str | Sequence[str] = (),
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose the gap between a campaign and a model: where it lies, which effect causes it, how far it shrinks.

    Parameters
    ----------
    campaign, model
        As for `identify`.
    effects
        Candidates: all shipped ones that fit by default. Objects and files (``path/to/file.py:Name``) join them.
    settings
        Bounds, fixed parameters, scopes, seed, threads; the rest is for identifications.
    include
        Effects that are part of the model, as ``start:STATE``.
    tests, hold_out
        As for `identify`.
    out
        Folder for ``diagnosis.html`` and ``diagnosis.json``; by default nothing is written.
    progress
        Called at the start of every step.

    Returns
    -------
    Diagnosis
        Shows itself in a notebook as its page.

    Raises
    ------
    InputError
        If campaign, model and effects don't fit together.
    """
    job = Job(
        campaign, model, as_effects(effects), (), as_names(tests), settings or Settings(),
        None if out is None else Path(out), hold_out=as_names(hold_out), included=as_effects(include),
    )  # fmt: skip
    if out is None:
        return diagnosed(job, listener(progress))[1]
    with page_beside() as drawn:
        return diagnosed(job, listener(progress), drawn)[1]


def predict(
    run: xr.DataTree | str | Path,
    campaign: Campaign | str | Path,
    *,
    model: Model | str | None = None,
    effects: str | Sequence[str] = (),
    tests: str | Sequence[str] = (),
    jobs: int = 1,
    progress: Progress | None = None,
) -> Result:
    """Predict the tests of a campaign from a run: a 90 % band of parameters, noise and model error.

    See `mofit.prediction.predict.predict`. Nothing is written.
    """
    from mofit.prediction import predict as predicted

    found = predicted(
        run, as_campaign(campaign), model=model, effects=as_names(effects), tests=as_names(tests), jobs=jobs,
        progress=listener(progress),
    )  # fmt: skip
    return Result.of(found)


def uncertainty(run: str | Path | xr.DataTree, parameters: str | Sequence[str] = ()) -> dict[str, object]:
    """Intervals, correlations and classification of every parameter: what ``mofit uncertainty --json`` prints.

    Parameters
    ----------
    run
        Folder of a finished run, or its tree. The page is `mofit.report_page(run, "uncertainty")`.
    parameters
        Those asked for: which of them the data do not identify stands in ``not_identifiable``.

    Raises
    ------
    InputError
        If there is no such run or parameter.
    """
    from mofit.report.uncertainty.table import uncertainty_summary

    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    return uncertainty_summary(tree, as_names(parameters))


def batch(
    *places: str | Path,
    out: str | Path,
    what: str = "identify",
    model: str | None = None,
    effects: str | Sequence[str] = (),
    settings: Settings | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Identify or diagnose every campaign of some folders; called again, it resumes.

    Parameters
    ----------
    places
        Campaign files, or folders of campaign files.
    out
        Folder for the runs, ``table.csv`` and ``batch.html``.
    what
        ``"identify"`` or ``"diagnose"``.
    model, effects, settings, progress
        As for `identify`; names only.
    jobs, scheduler
        Processes on this machine, or the address of a Dask scheduler.

    Raises
    ------
    InputError
        If places or options cannot be used. A campaign that cannot be used becomes a row with the reason.
    """
    from mofit.workflows.batch import BatchJob, run_batch

    job = BatchJob(
        tuple(map(Path, places)), Path(out), what, model, as_names(effects), settings or Settings(), jobs, scheduler
    )
    return run_batch(job, listener(progress))
