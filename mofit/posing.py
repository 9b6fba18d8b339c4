"""Posing the problem: which tests, what is free, what the calibration stages already know."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import Calibration, calibrated_values
from mofit.campaign import Campaign
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.joint import JointProblem
from mofit.model import Model
from mofit.objectives.prior import join_priors
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, build_problem
from mofit.settings import Settings

Array = NDArray[np.float64]


def choose_tests(model: Model, campaign: Campaign, tests: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the tests of the main identification: those asked for, else all of the model's kinds."""
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


def dynamic_problem(
    model: Model, campaign: Campaign, space: ParameterSpace, calibrations: list[Calibration], settings: Settings
) -> Problem:
    """What the search sees: calibrated parameters held at their estimates (free with ``joint``)."""
    known = {} if settings.joint else dict(calibrated_values(calibrations))
    free = [name for name in space.names if name not in known]
    if not free:
        what = "holds every parameter that is searched; the rest is what the calibration stages find"
        raise InputError.of("--fix", what, "Leave one more free, or add --joint")
    return build_problem(
        model, campaign, space=space.subset(free), fixed={**known, **settings.fixed}, jobs=settings.jobs
    )


def main_problem(
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


def search_weights(problem: Problem, settings: Settings) -> Array:
    """Weight of every test in the search, shape (tests,)."""
    raise_errors(
        Fault("--weights", f"no test '{name}'", did_you_mean(name, problem.tests))
        for name in settings.weights
        if name not in problem.tests
    )
    return np.array([settings.weights.get(name, 1.0) for name in problem.tests])
