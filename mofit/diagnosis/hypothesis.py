"""One explanation of a campaign: the model with certain effects, held against white rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.cause import Cause
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.steps import FEWEST_STEPS, RUNAWAY, bounded, tamed, with_enough_steps
from mofit.drives import to_drive
from mofit.kernel import Drive, Simulator
from mofit.model import Effect, System, with_effects
from mofit.parameters import ParameterSpace

Array = NDArray[np.float64]

#: Change of a white row by halving the integration steps that is let pass: noise is 1 there.
_STEP_ERROR = 0.05
#: Most numbers in the Jacobians that are computed at once: 80 MB.
_NUMBERS = 10**7


@dataclass(frozen=True)
class Linear:
    r"""A hypothesis at K points: :math:`r(u) \approx r + J (u - u_0)`, the prior's rows below those of the tests.

    Attributes
    ----------
    residual
        Measured minus simulated, white; (K, m + p). nan where a simulation failed.
    jacobian
        Minus the derivative of the simulated rows by the unit coordinates, (K, m + p, d).
    """

    residual: Array
    jacobian: Array


@dataclass(frozen=True)
class Hypothesis:
    """The observed tests, and a model with effects whose parameters are all free.

    Parameters
    ----------
    observed
        What is explained.
    causes
        Effects that are added to the model of ``observed.problem``.
    space
        Free parameters: those of the problem, then those of the effects.
    system, simulator
        The model with effects in vector form; compiled.
    """

    observed: Observed
    causes: tuple[Cause, ...]
    space: ParameterSpace
    system: System
    simulator: Simulator

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects."""
        return tuple(cause.effect for cause in self.causes)

    @cached_property
    def prior_rows(self) -> tuple[Array, Array]:
        """Rows R (p, d) and mean (d,): the prior is the squares of R (u - mean).

        An effect that the calibration tests had moved their estimates: its size stands in these rows too.
        """
        base, root = self.observed.prior_root
        rows = np.pad(root, ((0, 0), (0, len(self.space) - len(base))))
        mean = self.space.to_unit(self._neutral)
        mean[: len(base)] = base
        for cause in self.causes:
            mean[: len(base)] += cause.moved
            values = self._neutral
            for name, size, shift in zip(cause.effect.size, cause.around, cause.carried.T, strict=True):
                column = self.space.index(name)
                values[column] = size
                rows[:, column] = root @ shift * self.space.slope(values)[column]
                mean[column] = self.space.to_unit(values)[column]
        return rows, mean

    @property
    def _neutral(self) -> Array:
        """Values of the effects without size; of the model's own parameters, nominal ones."""
        return np.array([p.nominal if p.neutral is None else p.neutral for p in self.space.parameters])

    def full(self, u: Array) -> Array:
        """Values of all the system's parameters, (K, p), from points u (K, d)."""
        values, fixed = self.space.from_unit(u), self.observed.problem.fixed
        columns = [
            values[:, self.space.index(name)] if name in self.space.names else np.full(len(u), fixed[name])
            for name in self.system.parameters
        ]
        return np.stack(columns, axis=1)

    def linear(self, u: Array) -> Linear:
        """Residual and Jacobian at points u (K, d)."""
        stored = self.simulator.sensitivities(self.full(u))
        slope = np.nan_to_num(self.space.slope(self.space.from_unit(u)))
        joined = [np.concatenate([output[..., None], slopes], axis=-1) for output, slopes in stored]
        bad = np.any([~(np.abs(test) < RUNAWAY).all(axis=(1, 2, 3)) for test in joined], axis=0)
        for test in joined:
            test[bad] = 0.0
        white = self.observed.white(joined)
        root, mean = self.prior_rows
        residual = np.concatenate([self.observed.measured - white[..., 0], (mean - u) @ root.T], axis=1)
        residual[bad] = np.nan
        prior = np.broadcast_to(-root, (len(u), *root.shape))
        return Linear(residual, np.concatenate([-white[..., 1:] * slope[:, None, :], prior], axis=1))

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Negative log posterior (K,) up to a constant, gradient (K, d) and Gauss-Newton Hessian (K, d, d)."""
        # a few points at a time: rows of long tests fill the memory
        size = max(_NUMBERS // (len(self.observed.measured) * (len(self.space) + 1)), 1)
        parts = [self._normal(self.linear(u[start : start + size])) for start in range(0, len(u), size)]
        value, gradient, hessian = (np.concatenate(found) for found in zip(*parts, strict=True))
        return value, gradient, hessian

    def _normal(self, found: Linear) -> tuple[Array, Array, Array]:
        residual, jacobian = found.residual, found.jacobian
        value = 0.5 * np.einsum("km,km->k", residual, residual)
        turned = jacobian.transpose(0, 2, 1)
        # slopes near their limit overflow when squared: such a point counts as one that cannot be simulated
        with np.errstate(over="ignore", invalid="ignore"):
            gradient = (turned @ np.nan_to_num(residual)[..., None])[..., 0]
            return value, gradient, turned @ jacobian

    def with_steps(self, steps: int) -> Hypothesis:
        """The hypothesis with so many integration steps per sampling interval."""
        return replace(self, simulator=self.simulator.with_steps(steps))

    def at_steps_for(self, u: Array) -> Hypothesis:
        """The hypothesis with as many integration steps as points u (K, d) need for the noise of the tests.

        Slopes can run away where outputs do not: those of a stiff friction do.
        """
        values = self.full(u)

        def rows(at: Simulator) -> Array:
            stored = at.sensitivities(values)
            white = self.observed.white([tamed(output[..., None]) for output, _ in stored])
            return white if all(bounded(slopes) for _, slopes in stored) else np.full_like(white, RUNAWAY)

        def change(coarse: Array, fine: Array) -> float:
            return float(np.max(np.abs(fine - coarse)))

        return replace(self, simulator=with_enough_steps(self.simulator, rows, change, _STEP_ERROR)[0])


def hypothesis(observed: Observed, causes: Sequence[Cause] = ()) -> Hypothesis:
    """The problem's model with these effects, all parameters free."""
    problem, effects = observed.problem, [cause.effect for cause in causes]
    model = with_effects(problem.model, *effects)
    space = ParameterSpace((*problem.space.parameters, *model.parameters[len(problem.model.parameters) :]))
    drives = drives_of(observed, effects)
    system, simulator = observed.workshop.simulator(model, drives, space.names, FEWEST_STEPS)
    return Hypothesis(observed, tuple(causes), space, system, simulator)


def drives_of(observed: Observed, effects: Sequence[Effect]) -> Sequence[Drive]:
    """The tests with the inputs and conditions that effects need beside the model's."""
    problem = observed.problem
    if not any(effect.inputs or effect.conditions for effect in effects):
        return problem.drives
    model = with_effects(problem.model, *effects)
    return [
        to_drive(model, measurement, record, settled=False)
        for measurement, record in zip(problem.measurements, problem.records, strict=True)
    ]
