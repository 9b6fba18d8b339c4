"""Sequential estimation: parameters that tests of their own determine, before the main identification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.errors import InputError
from mofit.models import Model, Stage, find_model, laws_of, with_laws
from mofit.optimize import merge, refine
from mofit.parameters import ParameterSpace
from mofit.problem import GaussianPrior, Problem, adjusted_posterior, build_problem, explained
from mofit.sampling import laplace_covariance
from mofit.simulation import objective_pairs

#: Starts per stage; a power of two keeps the Sobol points balanced. Stages have two or three parameters.
STARTS = 32


@dataclass(frozen=True)
class Calibration:
    """One fitted stage: its problem, the minimum (unit coordinates) and the Hessian of -log of the normal posterior.

    ``freedom``: degrees of freedom of the noise behind it. ``memory``: what every record tells of long memory in the
    noise (1/f), see `mofit.data.signals.NoiseProcess`, (objectives, M).
    """

    stage: Stage
    problem: Problem
    minimum: FloatArray
    hessian: FloatArray
    freedom: float
    memory: FloatArray

    @property
    def outputs(self) -> list[str]:
        """Output of every objective, by name."""
        outputs = self.problem.model.outputs
        return [outputs[output].name for _, output in objective_pairs(self.problem.experiments)]

    def with_memory(self, memory: Mapping[str, FloatArray]) -> Calibration:
        """The same estimate, as certain as it is with the noise that all records of its outputs tell together.

        ``memory``: the sum over them, of every output by its name.
        """
        others = np.array([memory[name] for name in self.outputs]) - self.memory
        noise = replace(self.problem.noise, memory=others)
        return _calibration(self.stage, replace(self.problem, noise=noise), self.minimum)

    @property
    def values(self) -> dict[str, float]:
        """Estimate per parameter."""
        space = self.problem.space
        return dict(zip(space.names, map(float, space.from_unit(self.minimum)), strict=True))

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation per parameter (Laplace approximation); the width of the box at most."""
        space = self.problem.space
        sd = np.sqrt(np.diag(laplace_covariance(self.hessian)))
        return dict(zip(space.names, map(float, sd * space.derivative(space.from_unit(self.minimum))), strict=True))

    def fixed_at(self, values: Mapping[str, float]) -> bool:
        """Whether these parameters were fixed at these values."""
        return all(self.problem.layout.fixed.get(name) == value for name, value in values.items())

    def prior(self, space: ParameterSpace) -> GaussianPrior:
        """The estimate as a prior, in the unit coordinates of another space that has its parameters."""
        own = self.problem.space
        target = space.subset(own.names)
        values = own.from_unit(self.minimum)
        ratio = target.derivative(values) / own.derivative(values)
        return GaussianPrior(own.names, target.to_unit(values), self.hessian * np.outer(ratio, ratio))


def calibrate(
    model: Model,
    campaign: Campaign,
    space: ParameterSpace,
    *,
    seed: int,
    jobs: int,
    done: Sequence[Calibration] = (),
    start: Mapping[str, float] = MappingProxyType({}),
) -> tuple[list[Calibration], list[str]]:
    """Fit every stage of a model that the campaign has tests for.

    Parameters
    ----------
    model
        Its ``stages`` are fitted in order; a stage may use what the ones before it found.
    campaign
        Each stage uses the tests of its excitations.
    space
        The main model's parameters, whose bounds apply to the stages as well.
    seed, jobs
        Seed of the starts; threads.
    done
        Stages fitted to this campaign before, for another model; those that are the same are not fitted again.
    start
        Values by name, one more start of every stage.

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
        tests = [m.name for m in campaign.measurements if m.kind in stage.excitations]
        reduced = stage_model(stage, model)
        if not tests:
            names = ", ".join(p.name for p in reduced.parameters)
            warnings.append(
                f"No {' or '.join(stage.excitations)} test: {names} are identified together with the others, without "
                "a calibration of their own."
            )
            continue
        known = calibrated_values(found)
        free = [p.name for p in reduced.parameters if p.name in space.names and p.name not in known]
        same = [c for c in done if c.stage == stage and c.problem.space == space.subset(free) and c.fixed_at(known)]
        if same:
            found.append(same[0])
            continue
        chosen, own = campaign.select(tests), space.subset(free)
        problem = build_problem(reduced, chosen, space=own, fixed=known, settled=stage.settled, jobs=jobs)
        found.append(_fit_stage(stage, problem, seed, start))
    memory = summed_memory(found)
    return [one.with_memory(memory) for one in found], warnings


def summed_memory(calibrations: Sequence[Calibration]) -> dict[str, FloatArray]:
    """What all records of an output together tell of long memory in its noise, by its name, (M,) each."""
    found: dict[str, FloatArray] = {}
    for one in calibrations:
        for name, own in zip(one.outputs, one.memory, strict=True):
            found[name] = found.get(name, 0.0) + own
    return found


def stage_model(stage: Stage, model: Model) -> Model:
    """The model of a stage; its parameters follow the laws that they follow in the main model."""
    return with_laws(find_model(stage.model), laws_of(model))


def calibrated_by(model: Model, campaign: Campaign) -> dict[str, Stage]:
    """The stage that calibrates a parameter, by its name; stages without tests in the campaign calibrate none."""
    kinds = {m.kind for m in campaign.measurements}
    stages = [stage for stage in model.stages if kinds & {*stage.excitations}]
    return {one.name: stage for stage in reversed(stages) for one in stage_model(stage, model).parameters}


def _fit_stage(stage: Stage, problem: Problem, seed: int, start: Mapping[str, float]) -> Calibration:
    """Least squares from many starts, then once more with the independent residuals counted."""
    from scipy.stats import qmc  # late: its import takes half a second

    scattered = qmc.Sobol(len(problem.space), rng=seed).random(STARTS)
    space = problem.space
    given = np.array([start.get(one.name, one.nominal) for one in space.parameters])
    known = np.stack([space.nominal, np.clip(given, space.lower, space.upper)][: 2 if start else 1])
    starts = np.concatenate([space.to_unit(known), scattered])
    with explained(problem):
        minima = merge(refine(problem.evaluate, starts))
        if not minima:
            raise InputError.of(f"stage '{stage.name}'", "no start could be simulated", "Check bounds and channels")
    problem = problem.with_noise_at(minima[0].point)
    best = merge(refine(problem.evaluate, minima[0].point[None]))[0]
    return _calibration(stage, problem, best.point)


def _calibration(stage: Stage, problem: Problem, point: FloatArray) -> Calibration:
    adjusted = adjusted_posterior(problem, point)
    return Calibration(
        stage, problem, point, adjusted.normal_hessian, adjusted.adjustment.freedom, adjusted.score.memory
    )


def calibrated_values(calibrations: Sequence[Calibration]) -> dict[str, float]:
    """Estimates of all stages together."""
    return {name: value for calibration in calibrations for name, value in calibration.values.items()}
