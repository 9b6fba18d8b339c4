"""Reference fits: every test alone, and the baseline model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.calibration import Calibration
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.result import LocalFit
from mofit.identification.result_tree.comparison import baseline_groups, per_frequency
from mofit.identification.settings import Settings
from mofit.identification.stages import fit, refined
from mofit.models import Model, find_model
from mofit.problem import Problem, adjusted_posterior
from mofit.runtime.log import StageTimer


def fit_references(
    searched: Problem,
    starts: FloatArray,
    model: Model,
    campaign: Campaign,
    calibrations: Sequence[Calibration],
    settings: Settings,
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """Fit each test alone and the baseline model.

    Parameters
    ----------
    searched
        The problem, with what is fixed at its best values for all tests together.
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
    timer = StageTimer()
    with timer.measure("per_frequency"):
        groups = {"/per_frequency": per_frequency(searched.space, _each_alone(searched, starts))}
    if model.baseline is not None:
        with timer.measure("baseline"):
            best = _baseline(find_model(model.baseline), campaign, searched.tests, calibrations, settings)
            groups |= baseline_groups(best)
    return groups, timer.seconds


def _each_alone(searched: Problem, starts: FloatArray) -> dict[str, LocalFit]:
    """Every test alone, as in the paper's Table 4: refined from the minima that the search found for any test.

    A single sine hardly informs some parameters, so the fixed ones take their estimates from all tests.
    """
    fits = {}
    for test in searched.tests:
        problem, minima = refined(searched.select([test]), starts)
        fits[test] = LocalFit(
            problem, tuple(replace(m, hessian=adjusted_posterior(problem, m.point).hessian) for m in minima)
        )
    return fits


def _baseline(
    reference: Model, campaign: Campaign, tests: Sequence[str], done: Sequence[Calibration], settings: Settings
) -> LocalFit:
    """The baseline model, identified in the same way."""
    names = {parameter.name for parameter in reference.parameters}
    stages = () if settings.joint else reference.stages
    staged = {parameter.name for stage in stages for parameter in find_model(stage.model).parameters}
    # what is fixed for the model is fixed for the baseline too, unless nothing would be left to search
    fixed = settings.fixed if names - staged - set(settings.fixed) else {}
    own = replace(
        settings,
        bounds={name: value for name, value in settings.bounds.items() if name in names},
        fixed={name: value for name, value in fixed.items() if name in names},
    )
    return fit(set_up_problem(reference, campaign, own, tests, done=done))
