"""Reference fits: every test alone, and the baseline model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from mofit.data import Campaign
from mofit.identification.allowance import enough_alone
from mofit.identification.calibration import stage_model
from mofit.identification.descents import starts_of
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.refinement import refined
from mofit.identification.result import LocalFit, Located
from mofit.identification.result_tree.comparison import baseline_groups, per_frequency
from mofit.identification.settings import Settings
from mofit.identification.stages import fit
from mofit.models import Model, find_model, laws_of, with_laws
from mofit.problem import Problem, adjusted_posterior
from mofit.runtime.progress import StageTimer
from mofit.simulation import measured_outputs

#: Best starts of a test that are refined on it alone; three minima are shown.
STARTS_ALONE = 8


def fit_references(
    located: Located, model: Model, campaign: Campaign, settings: Settings
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """Fit each test alone and the baseline model, after `locate_minima` of the same model, campaign and settings.

    Returns
    -------
    groups
        Of the result tree, by path.
    seconds
        That each of the two took.
    """
    timer = StageTimer()
    groups: dict[str, xr.Dataset] = {}
    if located.searched.simulator.free and enough_alone(located.searched):
        with timer.measure("per_frequency"):
            searched, fits = _each_alone(located)
            groups = {"/per_frequency": per_frequency(searched, fits)}
    if model.baseline is not None:
        with timer.measure("baseline"):
            main, reference = located.searched, with_laws(find_model(model.baseline), laws_of(model))
            tests = [m.name for m in main.measurements if measured_outputs(reference, m)]
            if tests:
                # the fit itself is not kept: it goes before its stage ends
                groups |= baseline_groups(_baseline(reference, campaign, tests, located, settings), main)
    return groups, timer.seconds


def _each_alone(located: Located) -> tuple[Problem, dict[str, LocalFit]]:
    """What is searched of every test alone, and the fit of each, as in the paper's Table 4.

    Each is refined from the minima that the search found for any test. A single sine hardly informs some parameters, so
    the fixed ones take their estimates from all tests, and so do the coefficients of laws: a test has one value of
    every condition.
    """
    searched, starts = _without_coefficients(located, _best(located)), starts_of(located.search)[0]
    starts = starts[:, [located.searched.space.index(name) for name in searched.space.names]]
    fits = {}
    for test in searched.tests:
        alone = searched.select([test])
        order = np.argsort(alone.objectives(starts).sum(axis=1), kind="stable")
        problem, minima = refined(alone, starts[order[: STARTS_ALONE if located.problem.evaluations is None else 1]])
        fits[test] = LocalFit(
            problem, tuple(replace(m, hessian=adjusted_posterior(problem, m.point).hessian) for m in minima)
        )
    return searched, fits


def _best(located: Located) -> dict[str, float]:
    """Values at the best minimum."""
    space = located.posterior.space
    return dict(zip(space.names, map(float, space.from_unit(located.minima[0].point)), strict=True))


def _without_coefficients(located: Located, best: Mapping[str, float]) -> Problem:
    """What is searched, without the coefficients of laws, which are at their best."""
    searched = located.searched.with_fixed(best)
    names = {name for law in laws_of(searched.model) for name in law.coefficients}
    if not names:
        return searched
    kept = [name for name in searched.space.names if name not in names]
    return searched.with_free(searched.space.subset(kept), {**searched.layout.fixed, **best})


def _baseline(
    reference: Model, campaign: Campaign, tests: Sequence[str], located: Located, settings: Settings
) -> LocalFit:
    """The baseline model, identified in the same way: where parameters follow laws from a start, not by a search."""
    names = {parameter.name for parameter in reference.parameters}
    stages = () if settings.joint else reference.stages
    staged = {parameter.name for stage in stages for parameter in stage_model(stage, reference).parameters}
    # what is fixed for the model is fixed for the baseline too, unless nothing would be left to search
    fixed = settings.fixed if names - staged - set(settings.fixed) else {}
    own = replace(
        settings,
        bounds={name: value for name, value in settings.bounds.items() if name in names},
        fixed={name: value for name, value in fixed.items() if name in names},
        scopes={name: per for name, per in settings.scopes.items() if name in names},
        pooled=tuple(name for name in settings.pooled if name in names),
    )
    start = _best(located) if laws_of(reference) else None
    setup = set_up_problem(reference, campaign, own, tests, done=located.calibrations, start=start)
    return fit(replace(setup, known=located.searched.experiments))
