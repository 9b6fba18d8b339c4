"""The main job: search → refine → sample → result; this file alone knows the order."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.assemble import assemble
from mofit.calibration import Calibration, calibrate, calibrated_values
from mofit.campaign import Campaign
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.joint import JointProblem
from mofit.library import find_model
from mofit.model import Model
from mofit.objectives.prior import join_priors
from mofit.outcome import Fit, Mode, Outcome
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, build_problem
from mofit.progress import Progress, silent
from mofit.refine import Minimum, merge, refine
from mofit.result import write_result
from mofit.run import plan_folder
from mofit.sample import SampleSettings, laplace_covariance, laplace_log_evidence, mode_weights, sample_mode
from mofit.search import PAPER, EffaSettings, SearchResult, effa

Array = NDArray[np.float64]

SEARCHES: Mapping[str, EffaSettings] = {"effa": EffaSettings(), "paper": PAPER}


@dataclass(frozen=True)
class Settings:
    """What decides an identification's numbers, and ``jobs``, which does not.

    Parameters
    ----------
    search
        ``"effa"`` (cluster bests make trial moves, Sobol start) or ``"paper"`` (exactly as published).
    weights
        Weight of a test's NRMSD in the search; 1 where not named.
    seed
        Seed of every random draw.
    joint
        Identify calibration and dynamic parameters at once, all tests together.
    bounds, fixed
        Other bounds, or a fixed value, for parameters by name.
    least_weight
        Modes of less posterior weight are listed, not sampled.
    most_modes
        Most modes that are sampled.
    jobs
        Threads; all cores by default.
    """

    search: str = "effa"
    weights: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    joint: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    least_weight: float = 1e-3
    most_modes: int = 6
    sampling: SampleSettings = field(default_factory=SampleSettings)
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)

    def deciding(self) -> dict[str, object]:
        """The settings that decide the numbers, as plain data."""
        return {key: value for key, value in asdict(self).items() if key != "jobs"}


@dataclass(frozen=True)
class Clock:
    """Seconds per stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the time spent in the block to a stage."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


def identify(
    campaign: Campaign,
    model: Model,
    settings: Settings | None = None,
    *,
    tests: tuple[str, ...] = (),
    out: Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> tuple[Path, Outcome]:
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
    outcome
        Everything found, in memory.

    Raises
    ------
    InputError
        If campaign, model and settings don't fit together; nothing is written then.
    """
    settings = settings or Settings()
    clock = Clock()
    space = _space(model, settings)
    chosen = _choose_tests(model, campaign, tests)
    configuration = {"model": model.name, "campaign": campaign.hash(), "tests": list(chosen), **settings.deciding()}
    folder = plan_folder(out, f"{_slug(campaign.title)}-{model.name}", configuration, resume=resume)

    with clock.measure("calibrate"):
        progress("calibrate", 0, 1, "steady state and spring" if model.stages else "")
        calibrations, warnings = calibrate(model, campaign, space, seed=settings.seed, jobs=settings.jobs)
    with clock.measure("prepare"):
        selected = campaign.select(chosen)
        dynamic = _dynamic_problem(model, selected, space, calibrations, settings)
        problem = _main_problem(model, selected, space, calibrations, settings)
    with clock.measure("search"):
        found = _search(dynamic, settings, progress)
    with clock.measure("refine"):
        progress("refine", 0, 1, "")
        problem, minima = _refine(problem, _lift(found, dynamic, problem, calibrations))
        plausible = _plausible(minima, settings)
    with clock.measure("per_frequency"):
        per_test = _per_test(dynamic, settings, progress)
    with clock.measure("baseline"):
        baseline = _baseline(model, campaign, selected, settings)
    with folder.at_work(configuration) as unfinished:
        with clock.measure("sample"):
            modes = _sample(problem, plausible, settings, unfinished / "chains.h5", progress)
        outcome = Outcome(
            campaign=campaign,
            configuration=configuration,
            calibrations=tuple(calibrations),
            problem=problem.main if isinstance(problem, JointProblem) else problem,
            dynamic=dynamic,
            search=found,
            weights=_weights(dynamic, settings),
            minima=minima,
            modes=modes,
            baseline=baseline,
            per_test=per_test,
            seconds=clock.seconds,
            warnings=tuple(warnings + [reason for mode in modes for reason in mode.chains.reasons]),
        )
        with clock.measure("write"):
            write_result(assemble(outcome), unfinished)
    return folder.target, outcome


def _slug(title: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in title.lower()).split())[:40] or "run"


def _space(model: Model, settings: Settings) -> ParameterSpace:
    """Free parameters: the model's, without the fixed ones, in the bounds asked for."""
    space = ParameterSpace(model.parameters)
    raise_errors(
        Fault(f"option '{name}'", f"model '{model.name}' has no such parameter", did_you_mean(name, space.names))
        for name in (*settings.bounds, *settings.fixed)
        if name not in space.names
    )
    for name, (lower, upper) in settings.bounds.items():
        space = space.with_bounds(name, lower, upper)
    free = [name for name in space.names if name not in settings.fixed]
    if not free:
        raise InputError.of("--fix", "no parameter is left free", "Leave at least one free")
    return space.subset(free)


def _choose_tests(model: Model, campaign: Campaign, tests: tuple[str, ...]) -> tuple[str, ...]:
    if tests:
        return tests
    chosen = tuple(m.name for m in campaign.measurements if not model.procedures or m.kind in model.procedures)
    if not chosen:
        kinds = ", ".join(sorted({m.kind for m in campaign.measurements}))
        raise InputError.of(
            f"campaign '{campaign.title}'",
            f"model '{model.name}' takes {', '.join(model.procedures)} tests; the campaign has {kinds}",
            "Choose another model or campaign",
        )
    return chosen


def _dynamic_problem(
    model: Model, campaign: Campaign, space: ParameterSpace, calibrations: list[Calibration], settings: Settings
) -> Problem:
    """What the search sees: calibrated parameters held at their estimates (free with ``joint``)."""
    known = {} if settings.joint else dict(calibrated_values(calibrations))
    free = [name for name in space.names if name not in known]
    return build_problem(
        model, campaign, space=space.subset(free), fixed={**known, **settings.fixed}, jobs=settings.jobs
    )


def _main_problem(
    model: Model, campaign: Campaign, space: ParameterSpace, calibrations: list[Calibration], settings: Settings
) -> Problem | JointProblem:
    """What is refined and sampled: every parameter free, calibrations as priors (or, ``joint``, as data)."""
    prior = None
    if calibrations and not settings.joint:
        names = tuple(name for calibration in calibrations for name in calibration.problem.space.names)
        prior = join_priors([calibration.prior(space) for calibration in calibrations], names)
    main = build_problem(model, campaign, space=space, fixed=settings.fixed, prior=prior, jobs=settings.jobs)
    if settings.joint and calibrations:
        return JointProblem(main, tuple(calibration.problem for calibration in calibrations))
    return main


def _weights(problem: Problem, settings: Settings) -> Array:
    raise_errors(
        Fault("--weights", f"no test '{name}'", did_you_mean(name, problem.tests))
        for name in settings.weights
        if name not in problem.tests
    )
    return np.array([settings.weights.get(name, 1.0) for name in problem.tests])


def _search(problem: Problem, settings: Settings, progress: Progress) -> SearchResult:
    if settings.search not in SEARCHES:
        raise InputError.of("--search", f"unknown search '{settings.search}'", did_you_mean(settings.search, SEARCHES))
    return effa(
        problem.objectives,
        len(problem.space),
        np.random.default_rng(settings.seed),
        SEARCHES[settings.search],
        _weights(problem, settings),
        partial(_relay, progress, "search"),
    )


def _starts(found: SearchResult) -> Array:
    """Stored cluster bests, the best point of each test alone, and the final swarm."""
    rows = [*found.stored, *np.nanargmin(found.objectives, axis=0), *found.swarm]
    return found.points[list(dict.fromkeys(int(row) for row in rows))]


def _lift(
    found: SearchResult, dynamic: Problem, problem: Problem | JointProblem, calibrations: list[Calibration]
) -> Array:
    """The starts in the coordinates of the main problem."""
    known = calibrated_values(calibrations)
    values = dynamic.space.from_unit(_starts(found))
    columns = [
        values[:, dynamic.space.index(name)] if name in dynamic.space.names else np.full(len(values), known[name])
        for name in problem.space.names
    ]
    return problem.space.to_unit(np.stack(columns, axis=1))


def _refine(problem: Problem | JointProblem, starts: Array) -> tuple[Problem | JointProblem, tuple[Minimum, ...]]:
    """Refine, count the independent residuals at the best minimum, and refine again under that noise."""
    first = merge(refine(problem.evaluate, starts))
    if not first:
        raise InputError.of("refinement", "every start failed", "Check the model, or narrow the bounds")
    if isinstance(problem, JointProblem):
        problem = replace(problem, main=problem.main.with_noise_at(first[0].point))
    else:
        problem = problem.with_noise_at(first[0].point)
    again = refine(problem.evaluate, np.stack([minimum.point for minimum in first]))
    return problem, merge(again, values=lambda u: -problem.log_posterior(u))


def _plausible(minima: tuple[Minimum, ...], settings: Settings) -> list[tuple[Minimum, float]]:
    """Minima that carry posterior weight, with their log evidence (Laplace)."""
    evidence = np.array([laplace_log_evidence(m.value, m.hessian, m.point, m.gradient) for m in minima])
    weights = mode_weights(evidence)
    order = np.argsort(-evidence)[: settings.most_modes]
    return [(minima[i], float(evidence[i])) for i in order if weights[i] >= settings.least_weight]


def _sample(
    problem: Problem | JointProblem,
    modes: list[tuple[Minimum, float]],
    settings: Settings,
    path: Path,
    progress: Progress,
) -> tuple[Mode, ...]:
    weights = mode_weights(np.array([evidence for _, evidence in modes]))
    sampled = []
    for number, ((minimum, evidence), weight) in enumerate(zip(modes, weights, strict=True), start=1):
        chains = sample_mode(
            problem.log_posterior,
            minimum.point,
            laplace_covariance(minimum.hessian),
            (settings.seed, number),
            settings.sampling,
            backend_path=path,
            mode=f"c{number}",
            progress=partial(_relay, progress, f"sample mode {number} of {len(modes)}"),
        )
        sampled.append(Mode(f"c{number}", minimum, evidence, float(weight), chains))
    return tuple(sampled)


def _relay(progress: Progress, stage: str, done: float, total: float, note: str) -> None:
    progress(stage, done, total, note)


def _per_test(dynamic: Problem, settings: Settings, progress: Progress) -> dict[str, Fit]:
    """Every test alone, as in the paper's Table 4: its own search and refined minima."""
    fits = {}
    for number, test in enumerate(dynamic.tests):
        progress("per frequency", number, len(dynamic.tests), test)
        fits[test] = _fit(dynamic.select([test]), replace(settings, weights={}))
    return fits


def _fit(problem: Problem, settings: Settings) -> Fit:
    """Search and refine without sampling."""
    found = _search(problem, settings, silent)
    problem, minima = _refine(problem, _starts(found))  # type: ignore[assignment]
    return Fit(problem, minima)


def _baseline(model: Model, campaign: Campaign, selected: Campaign, settings: Settings) -> Fit | None:
    """The model that this one is compared with, identified in the same way."""
    if model.baseline is None:
        return None
    reference = find_model(model.baseline)
    names = {parameter.name for parameter in reference.parameters}
    own = replace(
        settings,
        bounds={name: value for name, value in settings.bounds.items() if name in names},
        fixed={name: value for name, value in settings.fixed.items() if name in names},
    )
    space = _space(reference, own)
    calibrations, _ = calibrate(reference, campaign, space, seed=settings.seed, jobs=settings.jobs)
    return _fit(_dynamic_problem(reference, selected, space, calibrations, own), own)
