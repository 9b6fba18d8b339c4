"""The main job: from a campaign and a model to a run directory with the result tree and the report."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import xarray as xr

from mofit.data import Campaign
from mofit.identification.inputs import as_campaign, as_model, as_names
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
from mofit.runtime.run_directory import LOG, run_folder


def identify(
    campaign: Campaign | str | Path,
    model: Model | str,
    settings: Settings | None = None,
    *,
    tests: str | Sequence[str] = (),
    out: str | Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> tuple[Path, xr.DataTree]:
    """Identify a model's parameters from a campaign.

    Parameters
    ----------
    campaign
        The measurements, or the path of their file.
    model
        The model, or its name: a shipped one's, or ``path/to/file.py:Name``.
    settings
        Settings of the identification.
    tests
        Name or names of the tests of the main identification; by default all whose excitation the model is made for.
    out
        Folder of the run; by default the next free one under ``runs/``.
    resume
        Take up an interrupted run with the same settings, if there is one.
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
        If campaign, model and settings don't fit together, or the folder can't be had; nothing is written then.
    WriteError
        If the disk fills up; what was written before stays, and ``resume`` goes on.
    """
    campaign, model, settings = as_campaign(campaign), as_model(model), settings or Settings()
    progress = log = RunLog(progress)
    timer = StageTimer()
    chosen = choose_tests(model, campaign, as_names(tests))
    configuration = {
        "model": model.name,
        "equations": build_system(model).hash(),
        "campaign": campaign.hash(),
        "tests": list(chosen),
        **settings.deciding(),
    }
    stem = f"{_slug(campaign.title)}-{model.name}"
    with run_folder(out, stem, configuration, resume=resume) as folder, report_beside() as drawn:
        log.write_to(folder.partial / LOG)
        located = locate_minima(campaign, model, settings, chosen, timer=timer, progress=progress)
        references = partial(fit_references, located, model, campaign, settings)
        with beside(references, settings.jobs > 1) as fitted:
            with timer.measure("sample"):
                chains = folder.partial / "chains.h5"
                modes = sample_modes(located.posterior, located.minima, settings, chains, progress)
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
            with drawn(tree, folder.partial):
                write_result(tree, folder.partial)
            for warning in result.warnings:
                log.note(f"warning: {warning}")
            log.note("converged" if result.converged else "NOT converged")
    return folder.target, tree


def _slug(title: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in title.lower()).split())[:40] or "run"
