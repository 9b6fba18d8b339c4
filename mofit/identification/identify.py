"""The main job: from a campaign and a model to a run directory with the result tree and the report."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.data.set_points import at_set_points
from mofit.identification.allowance import cut_short, keep_for_predictions, shortages
from mofit.identification.conditions import study_conditions
from mofit.identification.estimates import estimates, unrefined
from mofit.identification.findings import Finding, at_limits, misfit, of_laws, ridges
from mofit.identification.held_out import of_conditions, remaining_tests, with_predictions, without_held_out
from mofit.identification.inputs import as_campaign, as_model, as_names
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.reference_fits import fit_references
from mofit.identification.result import IdentificationResult, Located, PosteriorMode
from mofit.identification.result_tree import assemble
from mofit.identification.result_tree.simulations import with_simulations
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Model, build_system
from mofit.problem import Problem
from mofit.report import report_beside
from mofit.results import write_result
from mofit.runtime.files import write_text
from mofit.runtime.memory import give_back, return_at_once
from mofit.runtime.names import slug
from mofit.runtime.parallel import beside
from mofit.runtime.progress import Progress, RunLog, StageTimer, silent
from mofit.runtime.run_directory import LOG, run_folder
from mofit.simulation.evaluation.evaluations import evaluations_of, simulator_of, with_evaluations
from mofit.simulation.evaluation.executors import KEPT, evaluated_in
from mofit.simulation.table_cache import drop_tables

#: Point estimates of an identification that is not finished, in its folder.
ESTIMATES_FILE = "estimates.json"
#: Seconds of a time limit that are kept for reference fits, result and report, but at most a third of it.
RESERVE = 30.0
#: Share of a time limit at which searches and refinements end.
REFINED = 0.5


def identify(
    campaign: Campaign | str | Path,
    model: Model | str,
    settings: Settings | None = None,
    *,
    tests: str | Sequence[str] = (),
    hold_out: str | Sequence[str] = (),
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
    hold_out
        Name or names of tests that are not used at all, but predicted afterwards: group ``held_out`` of the result.
        ``condition=value`` names all tests of a condition.
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
        The result, as in that file. In a large one, what is simulated is computed whenever it is read.

    Raises
    ------
    InputError
        If campaign, model and settings don't fit together, or the folder can't be had; nothing is written then.
    WriteError
        If the disk fills up; what was written before stays, and ``resume`` goes on.
    """
    campaign, model = as_campaign(campaign), as_model(model)
    settings = (settings or Settings()).for_model(model)
    model = with_evaluations(model, settings.simulations)
    return_at_once()
    progress = log = RunLog(progress)
    timer, until = StageTimer(), _end_of_sampling(settings.time_limit)
    refined_until = math.inf if settings.time_limit is None else time.monotonic() + REFINED * settings.time_limit
    whole, (campaign, merged) = campaign, at_set_points(campaign, settings.over, settings.set_points)
    left = of_conditions(campaign, as_names(hold_out))
    campaign = without_held_out(campaign, left)
    chosen = remaining_tests(model, campaign, whole, as_names(tests))
    study = None
    if settings.over:
        with (
            timer.measure("conditions"),
            evaluated_in(evaluations_of(model), settings.jobs, settings.timeout, settings.dask),
        ):
            study = study_conditions(campaign, model, settings, chosen, progress=progress, until=refined_until)
        model, settings = study.model(model), study.settings(settings)
    configuration = {
        "model": model.name,
        "equations": build_system(model).hash(),
        "campaign": whole.hash(),
        "tests": list(chosen),
        **settings.deciding(),
        **({"hold_out": list(left)} if left else {}),
        **({"parameter_laws": [asdict(law) for law in study.laws]} if study else {}),
    }
    stem = f"{slug(campaign.title) or 'run'}-{model.name}"
    with (
        run_folder(out, stem, configuration, resume=resume) as folder,
        report_beside() as drawn,
        evaluated_in(evaluations_of(model), settings.jobs, settings.timeout, settings.dask, folder.partial),
    ):
        log.write_to(folder.partial / LOG)
        known = folder.partial / ESTIMATES_FILE
        found = partial(_write_unrefined, known)
        located = locate_minima(
            campaign, model, settings, chosen, timer=timer, progress=progress, searched=found, until=refined_until,
            start=study.fit.values if study else None,
        )  # fmt: skip
        keep_for_predictions(located.problem, len(left) and len(left) + len(chosen))
        references = partial(fit_references, located, model, campaign, settings)
        # a forked process would count its simulations for itself
        with beside(references, settings.jobs > 1 and simulator_of(model) is None) as fitted:
            with timer.measure("refine"):
                minima = adjusted_modes(located.posterior, located.minima, settings, until)
                write_text(known, json.dumps(estimates(located.problem, minima), indent=1))
            _make_room()
            with timer.measure("sample"):
                modes = sample_modes(minima, settings, folder.partial / "chains.h5", progress, until)
            _make_room()
            progress("compare", 0, 1, "each test alone and the baseline")
            groups, seconds = fitted()
            names = located.problem.space.names
            unconverged = (text for mode in modes if (text := mode.unconverged(names)))
            left_out = shortages(located.problem, list(groups))
            keep_for_predictions(located.problem, 0)
            result = IdentificationResult(
                **{
                    **vars(located),
                    "warnings": (*located.warnings, *unconverged, *left_out),
                    "findings": (
                        *located.findings,
                        *_findings(located, modes, settings),
                        *of_laws(study, whole, merged),
                    ),
                },
                campaign=whole,
                configuration=configuration,
                modes=modes,
                references=groups,
                study=study,
                seconds={**timer.seconds, **seconds, "total": timer.total},
            )
            _make_room()
            progress("write", 0, 1, "result and report")
            tree = with_predictions(assemble(result), model, whole, left, chosen, settings.jobs)
            tree = with_simulations(tree, result)
            with drawn(tree, folder.partial):
                write_result(tree, folder.partial)
            for warning in (*(finding.text for finding in result.findings), *result.warnings):
                log.note(f"warning: {warning}")
            known.unlink()
            (folder.partial / KEPT).unlink(missing_ok=True)
            log.note("converged" if result.converged else "NOT converged")
    return folder.target, tree


def _write_unrefined(file: Path, problem: Problem, points: FloatArray) -> None:
    write_text(file, json.dumps(unrefined(problem, points), indent=1))


def _make_room() -> None:
    """Free what the next stage does not use: the tables of other problems."""
    drop_tables()
    give_back()


def _end_of_sampling(limit: float | None) -> float:
    """Time of `time.monotonic` at which sampling ends, so that the result is there within the limit."""
    return math.inf if limit is None else time.monotonic() + max(limit - RESERVE, 2 / 3 * limit)


def _findings(located: Located, modes: Sequence[PosteriorMode], settings: Settings) -> tuple[Finding, ...]:
    best, problem = modes[0], located.problem
    whole, space = best.minimum.hessian, problem.space
    return (
        *(found for mode in modes if mode.emulator and (found := mode.emulator.finding(mode.name))),
        *cut_short(problem),
        *misfit(problem, problem.objectives(best.minimum.point[None])[0]),
        *at_limits(space, best.minimum, whole, tuple(settings.bounds)),
        *ridges(space, best.minimum.point, whole, best.path),
    )
