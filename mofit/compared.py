"""What the result is held against: each test alone, and the model that this one is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.assemble.comparison import baseline_groups, per_frequency
from mofit.calibration import Calibration, calibrate
from mofit.campaign import Campaign
from mofit.journal import Clock
from mofit.library import find_model
from mofit.model import Model
from mofit.outcome import Fit
from mofit.posing import dynamic_problem
from mofit.problem import Problem
from mofit.refining import refined, starts_of
from mofit.searching import search
from mofit.settings import Settings, free_space
from mofit.spread import spread_problem

Array = NDArray[np.float64]


def compare(
    dynamic: Problem,
    starts: Array,
    model: Model,
    campaign: Campaign,
    calibrations: Sequence[Calibration],
    settings: Settings,
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """Fit each test alone and the baseline model.

    Parameters
    ----------
    dynamic
        The problem with what is held at its best values for all tests together.
    starts
        Points from which each test is refined.
    model, campaign, calibrations
        As for the model itself; the campaign whole.
    settings
        Settings of the identification.

    Returns
    -------
    groups
        Of the result tree, by path.
    seconds
        That each of the two took.
    """
    clock = Clock()
    with clock.measure("per_frequency"):
        groups = {"/per_frequency": per_frequency(dynamic.space, _each_alone(dynamic, starts))}
    if model.baseline is not None:
        with clock.measure("baseline"):
            fit = _baseline(find_model(model.baseline), campaign, dynamic.tests, calibrations, settings)
            groups |= baseline_groups(fit)
    return groups, clock.seconds


def _each_alone(dynamic: Problem, starts: Array) -> dict[str, Fit]:
    """Every test alone, as in the paper's Table 4: refined from the minima that the search found for any test.

    A lone sine says so little of some parameters that what is held fixed must be as good as all tests together make it.
    """
    fits = {}
    for test in dynamic.tests:
        problem, minima = refined(dynamic.select([test]), starts)
        fits[test] = Fit(problem, tuple(replace(m, hessian=spread_problem(problem, m.point).hessian) for m in minima))
    return fits


def _baseline(
    reference: Model, campaign: Campaign, tests: Sequence[str], done: Sequence[Calibration], settings: Settings
) -> Fit:
    """The model that this one is compared with, identified in the same way."""
    names = {parameter.name for parameter in reference.parameters}
    stages = () if settings.joint else reference.stages
    staged = {parameter.name for stage in stages for parameter in find_model(stage.model).parameters}
    # values held for the model are held for the baseline too, unless that leaves nothing of it to search
    held = settings.fixed if names - staged - set(settings.fixed) else {}
    own = replace(
        settings,
        bounds={name: value for name, value in settings.bounds.items() if name in names},
        fixed={name: value for name, value in held.items() if name in names},
    )
    space = free_space(reference, own)
    calibrations, _ = calibrate(reference, campaign, space, seed=settings.seed, jobs=settings.jobs, done=done)
    problem = dynamic_problem(reference, campaign.select(tests), space, calibrations, own)
    return Fit(*refined(problem, starts_of(search(problem, own))))
