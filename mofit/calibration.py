"""The stages before the main identification, as in the paper: steady state, then the spring, by least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign
from mofit.errors import InputError
from mofit.library import find_model
from mofit.model import Model, Stage
from mofit.objectives import GaussianPrior
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, build_problem
from mofit.refine import merge, refine
from mofit.sample import laplace_covariance
from mofit.sobol import sobol
from mofit.spread import spread_problem

Array = NDArray[np.float64]

#: Starts per stage; a power of two keeps the Sobol points balanced. Stages have two or three parameters.
STARTS = 32


@dataclass(frozen=True)
class Calibration:
    """One fitted stage: its problem, the minimum (unit coordinates) and the Hessian of -log posterior there."""

    stage: Stage
    problem: Problem
    minimum: Array
    hessian: Array

    @property
    def values(self) -> dict[str, float]:
        """Estimate per parameter."""
        space = self.problem.space
        return dict(zip(space.names, map(float, space.from_unit(self.minimum)), strict=True))

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation per parameter (Laplace approximation); as wide as the box where the tests are silent."""
        space = self.problem.space
        spread = np.sqrt(np.diag(laplace_covariance(self.hessian)))
        return dict(zip(space.names, map(float, spread * space.slope(space.from_unit(self.minimum))), strict=True))

    def knew(self, values: Mapping[str, float]) -> bool:
        """Whether the fit held parameters at these values."""
        return all(self.problem.fixed.get(name) == value for name, value in values.items())

    def prior(self, space: ParameterSpace) -> GaussianPrior:
        """What the stage knows, in the unit coordinates of another space that has its parameters."""
        own = self.problem.space
        target = space.subset(own.names)
        values = own.from_unit(self.minimum)
        stretch = target.slope(values) / own.slope(values)
        return GaussianPrior(own.names, target.to_unit(values), self.hessian * np.outer(stretch, stretch))


def calibrate(
    model: Model,
    campaign: Campaign,
    space: ParameterSpace,
    *,
    seed: int,
    jobs: int,
    done: Sequence[Calibration] = (),
) -> tuple[list[Calibration], list[str]]:
    """Fit every stage of a model that the campaign has tests for.

    Parameters
    ----------
    model
        Its ``stages`` are fitted in order; a stage may use what the ones before it found.
    campaign
        Tests of the kinds that a stage names are used.
    space
        The main model's parameters: their bounds hold for the stages as well.
    seed, jobs
        Seed of the starts; threads.
    done
        Stages fitted to this campaign before, for another model; those that are the same are not fitted again.

    Returns
    -------
    calibrations
        One per stage with tests.
    warnings
        One sentence per stage without.
    """
    found: list[Calibration] = []
    warnings = []
    for stage in model.stages:
        tests = [m.name for m in campaign.measurements if m.kind in stage.procedures]
        stage_model = find_model(stage.model)
        if not tests:
            names = ", ".join(p.name for p in stage_model.parameters)
            warnings.append(
                f"No {' or '.join(stage.procedures)} test: {names} are identified together with the others, without "
                "a calibration of their own."
            )
            continue
        known = {name: value for calibration in found for name, value in calibration.values.items()}
        free = [p.name for p in stage_model.parameters if p.name in space.names and p.name not in known]
        same = [c for c in done if c.stage == stage and c.problem.space == space.subset(free) and c.knew(known)]
        if same:
            found.append(same[0])
            continue
        problem = build_problem(
            stage_model,
            campaign.select(tests),
            space=space.subset(free),
            fixed=known,
            settled=stage.settled,
            jobs=jobs,
        )
        found.append(fit_stage(stage, problem, seed))
    return found, warnings


def fit_stage(stage: Stage, problem: Problem, seed: int) -> Calibration:
    """Least squares from many starts, then once more with the independent residuals counted."""
    scattered = sobol(len(problem.space), seed).random(STARTS)
    starts = np.concatenate([problem.space.to_unit(problem.space.nominal)[None], scattered])
    minima = merge(refine(problem.evaluate, starts))
    if not minima:
        raise InputError.of(f"stage '{stage.name}'", "no start could be simulated", "Check bounds and channels")
    problem = problem.with_noise_at(minima[0].point)
    best = merge(refine(problem.evaluate, minima[0].point[None]))[0]
    return Calibration(stage, problem, best.point, spread_problem(problem, best.point).hessian)


def calibrated_values(calibrations: list[Calibration]) -> Mapping[str, float]:
    """Estimates of all stages together."""
    return {name: value for calibration in calibrations for name, value in calibration.values.items()}
