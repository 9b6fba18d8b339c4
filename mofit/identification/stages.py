"""The stages of an identification, in order: calibrate, search, refine, sample."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.problem_setup import ProblemSetup, set_up_problem
from mofit.identification.refinement import log_evidence, plausible, refined, with_calibrated_free
from mofit.identification.result import LocalFit, Located, PosteriorMode
from mofit.identification.search_budget import search_budget
from mofit.identification.search_registry import find_search, search_settings
from mofit.identification.search_weights import search_weights
from mofit.identification.settings import Settings
from mofit.identification.steady_start import leads_said, led_setup
from mofit.identification.valley_path import along_valley
from mofit.identification.valleys import without_joined
from mofit.identification.widening import widenings, wider_scoped, wider_setup
from mofit.models import Model
from mofit.optimize import STAGES, Minimum, RefineSettings, SearchResult, merge, profile, refine
from mofit.optimize import Progress as SearchProgress
from mofit.problem import AdjustedPosterior, CampaignPosterior, Problem, adjusted_posterior, explained
from mofit.runtime.progress import Progress, StageTimer, silent
from mofit.sampling import (
    Chains,
    Evidence,
    StudentTMixture,
    bridge_log_evidence,
    laplace_covariance,
    mode_region,
    mode_weights,
    restricted,
    sample_mode,
)

P = TypeVar("P", bound=CampaignPosterior)
#: Hears of a problem and of the minima (k, d) that the search has found.
Searched = Callable[[Problem, FloatArray], None]

#: What is said where there was no time to refine and to look whether ranges are wide enough.
TIME_IS_UP = (
    "The time limit came before the minima were refined and their ranges seen to be wide enough: give more time, or "
    "narrow the ranges (--bounds)."
)
#: Draws per chain below which a mode counts as not sampled: the evidence is fitted to half of them.
FEWEST_DRAWS = 32
#: Distance, in standard deviations, within which a minimum lies in a valley that leads past it.
IN_VALLEY = 5.0


def locate_minima(
    campaign: Campaign,
    model: Model,
    settings: Settings,
    tests: Sequence[str] = (),
    *,
    timer: StageTimer | None = None,
    progress: Progress = silent,
    searched: Searched = lambda problem, points: None,
    until: float = math.inf,
) -> Located:
    """Calibrate, search and refine; see `mofit.identification.identify` for the parameters.

    ``searched`` is called with the problem and the minima (k, d) as soon as the first search has found them. From the
    time ``until`` of `time.monotonic` on, refinements end where they are and ranges are not widened.
    """
    timer = timer or StageTimer()
    with timer.measure("calibrate"):
        progress("calibrate", 0, 1, ", ".join(stage.title for stage in model.stages))
        setup = set_up_problem(model, campaign, settings, tests)
    located, notes = _located(setup, timer, progress, until, searched), list[str]()
    for widen in (led_setup, wider_scoped, partial(wider_setup, campaign=campaign, tests=tests)):
        if time.monotonic() > until:
            notes.append(TIME_IS_UP)
            break
        with timer.measure("refine"):
            wider = widen(setup, located.posterior, located.minima[0])
        if wider is None:
            continue
        new = [*widenings(setup.fitted, wider.fitted), *widenings(setup.space, wider.space), *leads_said(setup, wider)]
        for note in new:
            progress("search", 0, 0, str(note))
        setup, notes = wider, [*notes, *map(str, new)]
        located = _located(setup, timer, progress, until)
    return replace(located, warnings=(*located.warnings, *notes)) if notes else located


def _located(
    setup: ProblemSetup,
    timer: StageTimer,
    progress: Progress,
    until: float,
    tell: Searched = lambda problem, points: None,
) -> Located:
    """Search and refine in the ranges of a problem."""
    with timer.measure("prepare"):
        searched, posterior = setup.searched, setup.posterior
    with timer.measure("search"):
        found, weights = search(searched, setup.settings, partial(progress, "search"))
    with timer.measure("refine"):
        tell(searched, starts_of(found)[0])
        progress("refine", 0, 1, "")
        searched, rough = refined(searched, *starts_of(found), until)
        posterior, minima = with_calibrated_free(posterior, searched, rough, until)
    return Located(setup.calibrations, searched, found, weights, posterior, minima, setup.warnings)


def find_modes(
    campaign: Campaign, model: Model, settings: Settings, tests: Sequence[str] = ()
) -> tuple[PosteriorMode, ...]:
    """All stages, nothing written: the modes that `identify` reports, for studies."""
    located = locate_minima(campaign, model, settings, tests)
    return sample_modes(adjusted_modes(located.posterior, located.minima, settings), settings)


def search(
    problem: Problem, settings: Settings, progress: SearchProgress | None = None
) -> tuple[SearchResult, FloatArray]:
    """Search the box of the free parameters, all tests at once; also the weight of every objective, (objectives,).

    Raises
    ------
    InputError
        If there is no search or no test of a name in the settings, or if every start fails.
    """
    weights = search_weights(problem, settings.weights)
    run, rng = find_search(settings.search), np.random.default_rng(settings.seed)
    with explained(problem):
        budget = search_settings(settings.search, search_budget(problem, settings))
        found = run(problem.objectives, problem.gradients, len(problem.space), rng, budget, weights, progress)
    return found, weights


def fit(setup: ProblemSetup) -> LocalFit:
    """Search and refine without sampling, calibrated parameters fixed: reference fits and studies."""
    found, _ = search(setup.searched, setup.settings)
    return LocalFit(*refined(setup.searched, *starts_of(found)))


def starts_of(found: SearchResult) -> tuple[FloatArray, list[str]]:
    """The minima that the search archived, its best point of each objective, and the stage that found each."""
    best = [int(row) for row in np.nanargmin(found.objectives, axis=0)]
    stages = dict.fromkeys(best, "")
    if found.found_by:
        stages = {row: STAGES[0] if row in found.generations else STAGES[1] for row in best}
        stages |= dict(zip(found.archived.tolist(), found.found_by, strict=True))
    rows = list(dict.fromkeys([*found.archived.tolist(), *best]))
    return found.points[rows], [stages.get(row, "") for row in rows]


def adjusted_modes(
    posterior: CampaignPosterior, minima: Sequence[Minimum], settings: Settings, until: float = math.inf
) -> tuple[tuple[Minimum, AdjustedPosterior], ...]:
    """The plausible minima, each with its posterior adjusted to noise and gap and moved to that; most probable first.

    Where noise and gap weaken the likelihood, the priors of the stages move a minimum. ``until`` is that of
    `RefineSettings`.
    """
    located, valleys = [], list[StudentTMixture]()
    distinct = without_joined(posterior, plausible(minima, settings.least_probability))
    for minimum in distinct[: settings.most_modes]:
        if any(valley.distance(minimum.point[None])[0] < IN_VALLEY for valley in valleys):
            continue
        local = posterior.near(minimum.point[None], np.sqrt(np.diag(laplace_covariance(minimum.hessian))))
        adjusted = adjusted_posterior(local, minimum.point)
        if along_valley(adjusted.evaluate, minimum.point, adjusted.hessian) is not None:
            adjusted = adjusted.unmapped()
            valley = along_valley(adjusted.evaluate, minimum.point, adjusted.hessian)
            valleys += [] if valley is None else [valley]
        (moved, *_) = merge(refine(adjusted.evaluate, minimum.point[None], RefineSettings(merge=None, until=until)))
        located.append((replace(moved, found_by=minimum.found_by), adjusted))
    return tuple(sorted(located, key=lambda pair: -log_evidence(pair[0])))


def sample_modes(
    located: Sequence[tuple[Minimum, AdjustedPosterior]],
    settings: Settings,
    path: Path | None = None,
    progress: Progress = silent,
    until: float = math.inf,
) -> tuple[PosteriorMode, ...]:
    """Sample around every plausible minimum.

    Parameters
    ----------
    located
        From `adjusted_modes`.
    settings
        Settings of the identification.
    path
        File for the chains, from which an interrupted run is resumed; nothing is written without one.
    progress
        Called now and then.
    until
        Time of `time.monotonic` at which sampling ends with what there is.

    Returns
    -------
    tuple of PosteriorMode
        Best first, with their posterior probabilities.
    """
    values, centres = [minimum.value for minimum, _ in located], np.stack([minimum.point for minimum, _ in located])
    covariances = np.stack([laplace_covariance(minimum.hessian) for minimum, _ in located])
    sampled = []
    for index, (minimum, adjusted) in enumerate(located):
        name, covariance = f"m{index + 1}", covariances[index]
        sd = np.sqrt(np.diag(covariance))
        noise_hessian, adjusted = adjusted.noise_hessian, adjusted.local(minimum.point, sd)
        belongs = mode_region(index, values, centres, covariances)
        own = restricted(adjusted.log_posterior, belongs) if len(located) > 1 else adjusted.log_posterior
        profiles = profile(adjusted, minimum.point, sd)
        valley = along_valley(adjusted.evaluate, minimum.point, minimum.hessian)
        if valley is not None and len(located) > 1:  # it may lead on into another mode
            valley = valley.selected(belongs(valley.means))
        along = None if valley is None else valley.means
        chains, evidence = _unsampled(minimum)
        left = until - time.monotonic()
        if settings.sample and left > 0:
            drawn = sample_mode(
                own,
                minimum.point,
                covariance,
                (settings.seed, index + 1),
                settings.sampling,
                valley=valley,
                backend_path=path,
                mode=name,
                progress=partial(progress, f"sample mode {index + 1} of {len(located)}"),
                until=time.monotonic() + left / (len(located) - index),
            )
            if drawn.thinned().points.shape[1] >= FEWEST_DRAWS:
                chains, evidence = drawn, bridge_log_evidence(own, drawn.thinned(), settings.seed)
        sampled.append(PosteriorMode(name, minimum, noise_hessian, adjusted, evidence, 1.0, chains, profiles, along))
    probabilities = mode_weights([mode.evidence.log_evidence for mode in sampled])
    return tuple(replace(mode, probability=float(p)) for mode, p in zip(sampled, probabilities, strict=True))


def _unsampled(minimum: Minimum) -> tuple[Chains, Evidence]:
    """What stands in the place of chains: none, and the evidence by the Laplace approximation."""
    reason = "not sampled: standard deviations are those of the Laplace approximation"
    return Chains.none(len(minimum.point), reason), Evidence(log_evidence(minimum), np.nan)
