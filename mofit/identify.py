"""The main job: search → refine → sample → result; this file alone knows the order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.assemble import assemble
from mofit.calibration import calibrate, calibrated_values
from mofit.campaign import Campaign
from mofit.compared import compare
from mofit.forking import beside
from mofit.joint import JointProblem
from mofit.journal import Clock, Journal
from mofit.model import Model, build_system
from mofit.outcome import Mode, Outcome
from mofit.posing import choose_tests, dynamic_problem, main_problem, search_weights
from mofit.problem import Problem
from mofit.profiles import profile
from mofit.progress import Progress, silent
from mofit.refine import Minimum, RefineSettings, merge, refine
from mofit.refining import refined, starts_of
from mofit.report_beside import report_beside
from mofit.result import write_result
from mofit.run import plan_folder
from mofit.sample import (
    bridge_log_evidence,
    cell,
    laplace_covariance,
    laplace_log_evidence,
    mode_weights,
    restricted,
    sample_mode,
)
from mofit.searching import search
from mofit.settings import Settings, free_space
from mofit.spread import spread_problems

Array = NDArray[np.float64]
P = TypeVar("P", bound=Problem | JointProblem)

#: Minima of the searched parameters with less weight are not refined with the calibrated ones freed: freeing can raise
#: a weight, but not a thousandfold.
WEIGHT_BEFORE_FREEING = 1e-6
#: Standard deviation, in box widths, of where a minimum moves when the calibrated parameters are freed.
NEIGHBOURHOOD = 0.01


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
        Names of the tests of the main identification; all of the model's kinds if none is named.
    out
        Folder of the run; by default the next free one under ``runs/``.
    resume
        Take up an interrupted run with the same settings.
    progress
        Told what is being done.

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
    progress = journal = Journal(progress)
    clock = Clock()
    space = free_space(model, settings)
    chosen = choose_tests(model, campaign, tests)
    configuration = {
        "model": model.name,
        "equations": build_system(model).hash(),
        "campaign": campaign.hash(),
        "tests": list(chosen),
        **settings.deciding(),
    }
    folder = plan_folder(out, f"{_slug(campaign.title)}-{model.name}", configuration, resume=resume)

    with report_beside() as drawn:
        with clock.measure("calibrate"):
            progress("calibrate", 0, 1, "steady state and spring" if model.stages else "")
            calibrations, warnings = calibrate(model, campaign, space, seed=settings.seed, jobs=settings.jobs)
        with clock.measure("prepare"):
            selected = campaign.select(chosen)
            dynamic = dynamic_problem(model, selected, space, calibrations, settings)
            problem = main_problem(model, selected, space, calibrations, settings)
        with clock.measure("search"):
            found = search(dynamic, settings, partial(_relay, progress, "search"))
        with clock.measure("refine"):
            progress("refine", 0, 1, "")
            dynamic, rough = refined(dynamic, starts_of(found))
            problem, minima = _refine_all(problem, dynamic, rough, calibrated_values(calibrations))
        values = dict(zip(problem.space.names, problem.space.from_unit(minima[0].point), strict=True))
        comparison = partial(
            compare, dynamic.with_fixed(values), starts_of(found), model, campaign, calibrations, settings
        )
        with folder.at_work(configuration) as unfinished, beside(comparison, settings.jobs > 1) as compared:
            journal.write_to(unfinished / "run.log")
            with clock.measure("sample"):
                modes = _sample(problem, minima, settings, unfinished / "chains.h5", progress)
            progress("compare", 0, 1, "each test alone and the baseline")
            groups, seconds = compared()
            outcome = Outcome(
                campaign=campaign,
                configuration=configuration,
                calibrations=tuple(calibrations),
                problem=problem.main if isinstance(problem, JointProblem) else problem,
                dynamic=dynamic,
                search=found,
                weights=search_weights(dynamic, settings),
                minima=minima,
                modes=modes,
                compared=groups,
                seconds={**clock.seconds, **seconds, "total": clock.total},
                warnings=tuple(warnings + [reason for mode in modes for reason in mode.chains.reasons]),
            )
            progress("write", 0, 1, "result and report")
            tree = assemble(outcome)
            with drawn(tree, unfinished):
                write_result(tree, unfinished)
            for warning in outcome.warnings:
                journal.note(f"warning: {warning}")
            journal.note("converged" if outcome.converged else "NOT converged")
    return folder.target, tree


def sampled_modes(
    campaign: Campaign, model: Model, settings: Settings, tests: tuple[str, ...] = ()
) -> tuple[Mode, ...]:
    """The modes that `identify` would report, for studies: nothing is written."""
    space = free_space(model, settings)
    calibrations, _ = calibrate(model, campaign, space, seed=settings.seed, jobs=settings.jobs)
    selected = campaign.select(choose_tests(model, campaign, tests))
    dynamic = dynamic_problem(model, selected, space, calibrations, settings)
    dynamic, rough = refined(dynamic, starts_of(search(dynamic, settings)))
    problem, minima = _refine_all(
        main_problem(model, selected, space, calibrations, settings), dynamic, rough, calibrated_values(calibrations)
    )
    return _sample(problem, minima, settings, None, silent)


def _slug(title: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in title.lower()).split())[:40] or "run"


def _plausible(minima: tuple[Minimum, ...], least_weight: float) -> list[Minimum]:
    """Minima that carry posterior weight (Laplace), the one that carries most first."""
    evidence = np.array([_evidence(minimum) for minimum in minima])
    weights = mode_weights(evidence)
    return [minima[i] for i in np.argsort(-evidence, kind="stable") if weights[i] >= least_weight]


def _refine_all(
    problem: Problem | JointProblem, dynamic: Problem, minima: tuple[Minimum, ...], known: Mapping[str, float]
) -> tuple[Problem | JointProblem, tuple[Minimum, ...]]:
    """Free the calibrated parameters as well, starting from the plausible minima of the searched ones."""
    candidates = _plausible(minima, WEIGHT_BEFORE_FREEING)
    values = dynamic.space.from_unit(np.stack([minimum.point for minimum in candidates]))
    columns = [
        values[:, dynamic.space.index(name)] if name in dynamic.space.names else np.full(len(values), known[name])
        for name in problem.space.names
    ]
    starts = problem.space.to_unit(np.stack(columns, axis=1))
    local = problem.with_noise(dynamic.noise).near(starts, np.full(len(problem.space), NEIGHBOURHOOD))
    return refined(local, starts)


def _sample(
    problem: Problem | JointProblem,
    minima: tuple[Minimum, ...],
    settings: Settings,
    path: Path | None,
    progress: Progress,
) -> tuple[Mode, ...]:
    plausible = _plausible(minima, settings.least_weight)
    spreads = []
    for minimum in plausible[: settings.most_modes]:
        local = problem.near(minimum.point[None], np.sqrt(np.diag(laplace_covariance(minimum.hessian))))
        wide, narrow = spread_problems(local, minimum.point)
        # where noise and gap weaken the likelihood, the priors of the stages move the minimum
        (moved, *_) = merge(refine(wide.evaluate, minimum.point[None], RefineSettings(join=None)))
        spreads.append((moved, wide, narrow))
    spreads.sort(key=lambda spread: -_evidence(spread[0]))
    values, centres = [m.value for m, _, _ in spreads], np.stack([m.point for m, _, _ in spreads])
    covariances = np.stack([laplace_covariance(m.hessian) for m, _, _ in spreads])
    sampled = []
    for index, (minimum, wide, narrow) in enumerate(spreads):
        name, covariance = f"c{index + 1}", covariances[index]
        sd = np.sqrt(np.diag(covariance))
        wide = wide.around(minimum.point, sd)
        belongs = cell(index, values, centres, covariances)
        own = restricted(wide.log_posterior, belongs) if len(spreads) > 1 else wide.log_posterior
        chains = sample_mode(
            own,
            minimum.point,
            covariance,
            (settings.seed, index + 1),
            settings.sampling,
            backend_path=path,
            mode=name,
            progress=partial(_relay, progress, f"sample mode {index + 1} of {len(spreads)}"),
        )
        evidence = bridge_log_evidence(own, chains.thinned(), settings.seed)
        spread = profile(wide, minimum.point, sd)
        sampled.append(Mode(name, minimum, narrow.hessian, wide, evidence, 1.0, chains, spread))
    weights = mode_weights([mode.evidence.log_evidence for mode in sampled])
    return tuple(replace(mode, weight=float(weight)) for mode, weight in zip(sampled, weights, strict=True))


def _evidence(minimum: Minimum) -> float:
    return laplace_log_evidence(minimum.value, minimum.hessian, minimum.point, minimum.gradient)


def _relay(progress: Progress, stage: str, done: float, total: float, note: str) -> None:
    progress(stage, done, total, note)
