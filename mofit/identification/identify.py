"""The main job: from a campaign and a model to a run directory with the result tree and the report."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import xarray as xr

from mofit.data import Campaign
from mofit.identification.problem_setup import choose_tests
from mofit.identification.reference_fits import fit_references
from mofit.identification.result import IdentificationResult
from mofit.identification.result_tree import assemble
from mofit.identification.settings import Settings
from mofit.identification.stages import locate_minima, sample_modes
from mofit.models import Model, build_system
from mofit.report import report_beside
from mofit.results import write_result
from mofit.runtime.parallel import beside
from mofit.runtime.progress import Progress, RunLog, StageTimer, silent
from mofit.runtime.run_directory import plan_folder


def identify(
    campaign: Campaign,
    model: Model,
    settings: Settings | None = None,
    *,
    tests: tuple[str, ...] = (),
    out: Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> tuple[Path, xr.DataTree]:
    """Identify a model's parameters from a campaign.

    Parameters
    ----------
    campaign
        The measurements.
    model
        The model.
    settings
        Settings of the identification.
    tests
        Names of the tests of the main identification; by default all whose excitation the model is made for.
    out
        Folder of the run; by default the next free one under ``runs/``.
    resume
        Take up an interrupted run with the same settings.
    progress
        Called as ``progress(stage, done, total, note)``.

    Returns
    -------
    folder
        The run's folder, with ``result.nc`` and ``chains.h5``.
    tree
        The result, as in that file.

    Raises
    ------
    InputError
        If campaign, model and settings don't fit together; nothing is written then.
    """
    settings = settings or Settings()
    progress = log = RunLog(progress)
    timer = StageTimer()
    tests = choose_tests(model, campaign, tests)
    configuration = {
        "model": model.name,
        "equations": build_system(model).hash(),
        "campaign": campaign.hash(),
        "tests": list(tests),
        **settings.deciding(),
    }
    folder = plan_folder(out, f"{_slug(campaign.title)}-{model.name}", configuration, resume=resume)

    with report_beside() as drawn:
        located = locate_minima(campaign, model, settings, tests, timer=timer, progress=progress)
        references = partial(fit_references, located, model, campaign, settings)
        with folder.at_work(configuration) as unfinished, beside(references, settings.jobs > 1) as fitted:
            log.write_to(unfinished / "run.log")
            with timer.measure("sample"):
                modes = sample_modes(located.posterior, located.minima, settings, unfinished / "chains.h5", progress)
            progress("compare", 0, 1, "each test alone and the baseline")
            groups, seconds = fitted()
            unconverged = (reason for mode in modes for reason in mode.chains.reasons)
            result = IdentificationResult(
                **{**vars(located), "warnings": (*located.warnings, *unconverged)},
                campaign=campaign,
                configuration=configuration,
                modes=modes,
                references=groups,
                seconds={**timer.seconds, **seconds, "total": timer.total},
            )
            progress("write", 0, 1, "result and report")
            tree = assemble(result)
            with drawn(tree, unfinished):
                write_result(tree, unfinished)
            for warning in result.warnings:
                log.note(f"warning: {warning}")
            log.note("converged" if result.converged else "NOT converged")
    return folder.target, tree


def _slug(title: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in title.lower()).split())[:40] or "run"
