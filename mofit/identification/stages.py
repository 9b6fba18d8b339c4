"""The stages of an identification, in order: calibrate, search, refine, sample."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.allowance import check_allowed, check_left, enough_to_search, keep_for_sampling
from mofit.identification.descents import completed, descend, settings_for, starts_of
from mofit.identification.findings import Finding
from mofit.identification.mode_sampling import sample_modes
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
from mofit.optimize import Minimum, SearchResult, merge, only_point
from mofit.optimize import Progress as SearchProgress
from mofit.problem import AdjustedPosterior, CampaignPosterior, Problem, adjusted_posterior, explained
from mofit.runtime.progress import Progress, StageTimer, silent
from mofit.sampling import StudentTMixture, laplace_covariance
from mofit.simulation.evaluation.evaluations import with_evaluations

P = TypeVar("P", bound=CampaignPosterior)
#: Hears of a problem and of the minima (k, d) that the search has found.
Searched = Callable[[Problem, FloatArray], None]

#: Found where there was no time to refine and to look whether ranges are wide enough.
TIME_IS_UP = Finding(
    "time limit",
    "caution",
    "The time limit came before the minima were refined and their ranges seen to be wide enough: give more time, or "
    "narrow the ranges (--bounds).",
)
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
    start: Mapping[str, float] | None = None,
) -> Located:
    """Calibrate, search and refine; see `mofit.identification.identify` for the parameters.

    With a ``start``, values of the parameters by name, that is refined, nothing searched. ``searched`` is called with
    the problem and the minima (k, d) as soon as the first search has found them. From the time ``until`` of
    `time.monotonic` on, refinements end where they are and ranges are not widened, nor with too few simulations left.
    """
    timer = timer or StageTimer()
    with timer.measure("calibrate"):
        progress("calibrate", 0, 1, ", ".join(stage.title for stage in model.stages))
        setup = set_up_problem(model, campaign, settings, tests, start=start)
    located, notes, found = _located(setup, timer, progress, until, searched), list[str](), tuple[Finding, ...]()
    for widen in (led_setup, wider_scoped, partial(wider_setup, campaign=campaign, tests=tests)):
        if time.monotonic() > until:
            found = (TIME_IS_UP,)
            break
        if not enough_to_search(located.searched):
            break
        with timer.measure("refine"):
            wider = widen(setup, located.posterior, located.minima[0])
        if wider is None or not enough_to_search(located.searched):
            continue
        new = [*widenings(setup.fitted, wider.fitted), *widenings(setup.space, wider.space), *leads_said(setup, wider)]
        for note in new:
            progress("search", 0, 0, str(note))
        setup, notes = wider, [*notes, *map(str, new)]
        located = _located(setup, timer, progress, until)
    check_left(located.problem)
    return replace(located, warnings=(*located.warnings, *notes), findings=found)


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
        keep_for_sampling(searched)
    with timer.measure("search"):
        found, weights = _started(searched, setup) or search(searched, setup.settings, partial(progress, "search"))
    with timer.measure("refine"):
        found, starts = _with_starts(searched, found, until)
        tell(searched, starts[0])
        progress("refine", 0, 1, "")
        searched, rough = refined(searched, *starts, until)
        posterior, minima = with_calibrated_free(posterior, searched, rough, until)
    return Located(setup.calibrations, searched, found, weights, posterior, minima, setup.warnings, ())


def _started(searched: Problem, setup: ProblemSetup) -> tuple[SearchResult, FloatArray] | None:
    """In place of a search, the point to start from; None where there is none."""
    if setup.start is None:
        return None
    space = searched.space
    values = [setup.start.get(one.name, one.nominal) for one in space.parameters]
    point = np.clip(space.to_unit(np.clip(values, space.lower, space.upper)), 0.0, 1.0)
    weights = search_weights(searched, setup.settings.weights)
    with explained(searched):
        return only_point(searched.objectives, point, weights), weights


def find_modes(
    campaign: Campaign, model: Model, settings: Settings, tests: Sequence[str] = ()
) -> tuple[PosteriorMode, ...]:
    """All stages, nothing written: the modes that `identify` reports, for studies."""
    settings = settings.for_model(model)
    located = locate_minima(campaign, with_evaluations(model, settings.simulations), settings, tests)
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
    check_allowed(problem)
    name = str(settings.for_model(problem.model).search)
    run, rng = find_search(name), np.random.default_rng(settings.seed)
    with explained(problem):
        budget = search_settings(name, search_budget(problem, settings))
        found = run(problem.objectives, problem.gradients, len(problem.space), rng, budget, weights, progress)
    return found, weights


def fit(setup: ProblemSetup) -> LocalFit:
    """Search (or start) and refine without sampling, calibrated parameters fixed: reference fits and studies."""
    found, _ = _started(setup.searched, setup) or search(setup.searched, setup.settings)
    return LocalFit(*refined(setup.searched, *_with_starts(setup.searched, found)[1]))


def _with_starts(
    problem: Problem, found: SearchResult, until: float = math.inf
) -> tuple[SearchResult, tuple[FloatArray, Sequence[str]]]:
    """The search, of a costly simulator completed, and the starts (k, d) of the refinement, each with its stage."""
    if problem.evaluations is None:
        return found, starts_of(found)
    found, minima = completed(problem, found, until)
    return found, (minima, [""] * len(minima))


def adjusted_modes(
    posterior: CampaignPosterior, minima: Sequence[Minimum], settings: Settings, until: float = math.inf
) -> tuple[tuple[Minimum, AdjustedPosterior], ...]:
    """The plausible minima, each with its posterior adjusted to noise and gap and moved to that; most probable first.

    Where noise and gap weaken the likelihood, the priors of the stages move a minimum. ``until`` is that of
    `RefineSettings`.
    """
    located, valleys = [], list[StudentTMixture]()
    descent = settings_for(posterior.main, merge=None, until=until)
    quick = posterior.main.evaluations is None  # to follow a valley takes thousands of simulations
    distinct = plausible(minima, settings.least_probability)
    distinct = without_joined(posterior, distinct) if quick else distinct
    for minimum in distinct[: settings.most_modes]:
        if any(valley.distance(minimum.point[None])[0] < IN_VALLEY for valley in valleys):
            continue
        local = posterior.near(minimum.point[None], np.sqrt(np.diag(laplace_covariance(minimum.hessian))))
        adjusted = adjusted_posterior(local, minimum.point)
        if quick and along_valley(adjusted.evaluate, minimum.point, adjusted.hessian) is not None:
            adjusted = adjusted.unmapped()
            valley = along_valley(adjusted.evaluate, minimum.point, adjusted.hessian)
            valleys += [] if valley is None else [valley]
        (moved, *_) = merge(descend(adjusted, minimum.point[None], descent))
        located.append((replace(moved, found_by=minimum.found_by), adjusted))
    return tuple(sorted(located, key=lambda pair: -log_evidence(pair[0])))
