"""A hypothesis: the model with certain effects, compared with whitened observations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.integration import DIVERGED, MOST_STEPS, clipped, stable, with_enough_steps, within
from mofit.diagnosis.scoped_layout import ScopedLayout, labels_of
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.models import Effect, with_effects
from mofit.parameters import ParameterSpace
from mofit.simulation import Simulator
from mofit.simulation.ranges import with_parameters

#: Most numbers in the Jacobians that are computed at once: 80 MB.
_NUMBERS = 10**7
#: Largest change of a whitened observation when the step is halved: small beside the noise, which is 1.
_OUTPUT_CHANGE = 0.05


@dataclass(frozen=True)
class Linear:
    r"""A hypothesis at K points: :math:`r(u) \approx r + J (u - u_0)`, the prior's rows below those of the tests.

    Attributes
    ----------
    residual
        Measured minus simulated, whitened; (K, m + p). nan where a simulation failed.
    jacobian
        Minus the derivative of the simulated rows by the unit coordinates, (K, m + p, d).
    """

    residual: FloatArray
    jacobian: FloatArray

    def normal_equations(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Half the sum of squares (K,), its gradient (K, d) and Gauss–Newton Hessian (K, d, d)."""
        value = 0.5 * np.einsum("km,km->k", self.residual, self.residual)
        turned = self.jacobian.transpose(0, 2, 1)
        # derivatives near their limit overflow when squared: such a point counts as one that cannot be simulated
        with np.errstate(over="ignore", invalid="ignore"):
            gradient = (turned @ np.nan_to_num(self.residual)[..., None])[..., 0]
            return value, gradient, turned @ self.jacobian


@dataclass(frozen=True)
class Hypothesis:
    """The tests, and a model with effects all of whose parameters are free.

    Parameters
    ----------
    observed
        The tests.
    discrepancies
        Effects that are added to the model of ``observed.problem``.
    layout
        All parameters of the system. Free are those of the problem, of the campaign first, then those of the effects.
    simulator
        The compiled model with effects.
    """

    observed: WhitenedData
    discrepancies: tuple[Discrepancy, ...]
    layout: ScopedLayout
    simulator: Simulator

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects."""
        return tuple(one.effect for one in self.discrepancies)

    @property
    def space(self) -> ParameterSpace:
        """The free parameters, each of their values as one."""
        return self.layout.space

    @property
    def steps(self) -> int:
        """Runge–Kutta steps per sampling interval."""
        return self.simulator.steps or 1

    @cached_property
    def prior_rows(self) -> tuple[FloatArray, FloatArray]:
        """Rows R (p, d) and mean (d,): the prior is the squares of R (u - mean).

        An effect present in the calibration tests moved their estimates: its size enters these rows too.
        """
        base, root = self.observed.prior_root
        rows = np.pad(root, ((0, 0), (0, len(self.space) - len(base))))
        mean = self.space.to_unit(self._neutral)
        mean[: len(base)] = base
        for one in self.discrepancies:
            mean[: len(base)] += one.shift
            if not one.present_in_calibration:
                continue
            values = self._neutral
            for name, size, shift in zip(one.effect.size, one.around, one.sensitivity.T, strict=True):
                column = self.space.index(name)
                values[column] = size
                rows[:, column] = root @ shift * self.space.derivative(values)[column]
                mean[column] = self.space.to_unit(values)[column]
        return rows, mean

    @property
    def _neutral(self) -> FloatArray:
        """Values of the effects without size; of the model's own parameters, nominal ones."""
        return np.array([p.nominal if p.neutral is None else p.neutral for p in self.space.parameters])

    def wider(self, sides: NDArray[np.int64]) -> Hypothesis | None:
        """The hypothesis with wider ranges of the effects' parameters at whose ends (d,) a fit is; None if none is."""
        layout = self.layout.farther(np.where(np.arange(len(sides)) < self.own, 0, sides))
        if layout is self.layout:
            return None
        known = layout.parameters
        wider = [
            replace(
                one,
                effect=with_parameters(one.effect, known.subset([p.name for p in one.effect.parameters]).parameters),
            )
            for one in self.discrepancies
        ]
        return replace(self, discrepancies=tuple(wider), layout=layout)

    @property
    def own(self) -> int:
        """Number of coordinates of the model's free parameters; those of the effects follow."""
        model = {*self.observed.problem.space.names, *self.observed.scoped.names}
        return sum(name in model for name, _ in self.layout.cells)

    def outputs(self, u: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Per test: outputs (K, n, outputs) and derivatives by the values of the free parameters (K, n, outputs, f)."""
        return self.simulator.sensitivities(self.layout.full(u))

    def stays_finite(self, u: FloatArray) -> NDArray[np.bool_]:
        """Whether the model can be simulated at points u (K, d)."""
        outputs = self.simulator.outputs_with_slopes(self.layout.full(u))  # by code that is there
        return np.all([within(test[..., 0], DIVERGED, (1, 2)) for test in outputs], axis=0)

    def linear(self, u: FloatArray) -> Linear:
        """Residual and Jacobian at points u (K, d)."""
        slope = np.nan_to_num(self.space.derivative(self.space.from_unit(u)))
        columns = self.simulator.outputs_with_slopes(self.layout.full(u))
        bad = np.any([~within(test, DIVERGED, (1, 2, 3)) for test in columns], axis=0)
        if bad.any():
            columns = [np.where(bad[:, None, None, None], 0.0, test) for test in columns]
        white = self.observed.whitened(columns)
        slopes = self.layout.spread(white[..., 1:], self.observed.test)
        root, mean = self.prior_rows
        # rows last in memory, as they come
        jacobian = np.empty((len(u), len(self.space), white.shape[1] + len(root))).transpose(0, 2, 1)
        np.multiply(slopes, -slope[:, None, :], out=jacobian[:, : white.shape[1]])
        jacobian[:, white.shape[1] :] = -root
        # no step can be had from derivatives that diverged where the outputs did not
        bad |= ~stable(jacobian, axis=(1, 2))
        residual = np.concatenate([self.observed.measured - white[..., 0], (mean - u) @ root.T], axis=1)
        residual[bad] = np.nan
        return Linear(residual, jacobian)

    def linear_parts(self, u: FloatArray) -> Iterator[Linear]:
        """`linear` at a few points at a time: rows of long tests fill the memory."""
        size = max(_NUMBERS // (len(self.observed.measured) * (len(self.space) + 1)), 1)
        return (self.linear(u[start : start + size]) for start in range(0, len(u), size))

    def with_steps(self, steps: int) -> Hypothesis:
        """The hypothesis with so many integration steps per sampling interval."""
        return replace(self, simulator=self.simulator.with_steps(steps))

    def at_steps_for(self, u: FloatArray, fewest: int = 1) -> Hypothesis:
        """The hypothesis with as many integration steps as points u (K, d) need for the noise of the tests.

        No fewer than ``fewest``: what was simulated with so many need not be again with fewer. Derivatives can diverge
        where outputs do not: those of a sharp dry friction do.
        """
        fewest = min(fewest, MOST_STEPS // 2)

        def rows(at: Simulator) -> FloatArray:
            found = replace(self, simulator=at).outputs(u)
            white = self.observed.whitened([clipped(output[..., None]) for output, _ in found])
            return white if all(stable(slopes) for _, slopes in found) else np.full_like(white, DIVERGED)

        def change(coarse: FloatArray, fine: FloatArray) -> float:
            return float(np.max(np.abs(fine - coarse)))

        return replace(self, simulator=with_enough_steps(self.simulator, rows, change, _OUTPUT_CHANGE, fewest)[0])


def hypothesis(observed: WhitenedData, discrepancies: Sequence[Discrepancy] = ()) -> Hypothesis:
    """The problem's model with these effects, all parameters free."""
    problem, effects = observed.problem, [one.effect for one in discrepancies]
    model = with_effects(problem.model, *effects)
    added = model.parameters[len(problem.model.parameters) :]
    space = ParameterSpace((*problem.space.parameters, *observed.scoped.parameters, *added))
    system, simulator = observed.simulators.simulator(model, experiments_of(problem, effects), space.names)
    layout = ScopedLayout(system.parameters, space, problem.layout.fixed, labels_of(space, problem.measurements))
    return Hypothesis(observed, tuple(discrepancies), layout, simulator)
