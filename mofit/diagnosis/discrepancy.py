"""An effect as a discrepancy of the model: in the dynamic tests alone, or present in the calibration tests too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from mofit._typing import FloatArray
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.integration import SimulatorCache, clipped, each_with_enough_steps
from mofit.identification.calibration import Calibration
from mofit.models import Effect, incompatibility, with_effects
from mofit.models.model import RECORD_LENGTH, SAMPLE_INTERVAL
from mofit.parameters import ParameterLayout, ParameterSpace
from mofit.simulation import objective_pairs

#: Runge–Kutta steps per sampling interval in the calibration tests, which are slow.
_STEPS = 2
#: Largest change when the step is halved: of all whitened samples of a stage together (root of the sum of squares),
#: and of the derivatives, relative, beyond what changes no more than that over a parameter's range.
_OUTPUT_CHANGE, _SENSITIVITY_CHANGE = 0.3, 0.03
#: Most evaluations when a stage is fitted again with an effect; it starts near its minimum.
_EVALUATIONS = 30


@dataclass(frozen=True)
class Discrepancy:
    r"""An effect at a point of its grid, and what it did to the calibration.

    With the effect's size a the stages would have found :math:`m + \Delta - B \, (a - a_0)` in place of m.

    Parameters
    ----------
    effect
        The effect.
    point
        Values of the parameters that are undefined without it.
    around
        Size a_0 at which the stages were fitted, (q,).
    shift
        :math:`\Delta`, in the unit coordinates of the problem's space, (d,).
    sensitivity
        B, per unit of the size, (d, q); zero where the effect was not present in the calibration tests.
    """

    effect: Effect
    point: Mapping[str, float]
    around: FloatArray
    shift: FloatArray
    sensitivity: FloatArray

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def present_in_calibration(self) -> bool:
        """Whether the effect was present in the calibration tests too."""
        return bool(np.any(self.sensitivity))


@dataclass(frozen=True)
class CalibrationStages:
    """The calibration stages, to be fitted again with effects in their tests.

    Parameters
    ----------
    space
        Free parameters of the main problem.
    calibrations
        The fitted stages.
    simulators
        Compiled models.
    """

    space: ParameterSpace
    calibrations: Sequence[Calibration]
    simulators: SimulatorCache

    def discrepancies(self, effect: Effect) -> list[Discrepancy]:
        """The effect at every point of its grid, in the dynamic tests alone and, where it moves the stages, in all."""
        neutral = np.array([effect.neutral[name] for name in effect.size])
        shift, sensitivity = np.zeros(len(self.space)), np.zeros((len(self.space), len(effect.size)))
        dynamic = [Discrepancy(effect, point, neutral, shift, sensitivity) for point in effect.grid_points]
        if effect.scoped:  # what differs from test to test is not known in those of the stages
            return dynamic
        everywhere = [self.recalibrated(one, {**effect.neutral, **one.point}) for one in dynamic]
        return [*dynamic, *(one for one in everywhere if one.present_in_calibration)]

    def recalibrated(self, discrepancy: Discrepancy, values: Mapping[str, float]) -> Discrepancy:
        """The discrepancy with the stages fitted again, the effect having these values in their tests.

        The fits start from the stages' parameters in ``values``, or from their estimates, where they stay if the effect
        is neutral. Where an effect is so large that a stage cannot be simulated or fitted with it, the discrepancy
        stays as it is.
        """
        effect, size = discrepancy.effect, np.array([values[name] for name in discrepancy.effect.size])
        shift, sensitivity = np.zeros(len(self.space)), np.zeros((len(self.space), len(effect.size)))
        neutral = all(values[name] == effect.neutral[name] for name in effect.size)
        own = {parameter.name: values[parameter.name] for parameter in effect.parameters}
        for calibration in self.calibrations:
            stage = calibration.problem
            if incompatibility(effect, stage.model) is not None or _needs_more_than_a_record(effect):
                continue
            place = [self.space.index(name) for name in stage.space.names]
            known = self.space.subset(stage.space.names)
            estimate = calibration.values
            start = estimate if neutral else {name: values.get(name, estimate[name]) for name in estimate}
            found, slope = self._refitted(calibration, effect, own, start, not neutral)
            # a stage that diverged may have left the logarithms' domain
            with np.errstate(invalid="ignore"):
                shift[place] += known.to_unit(found) - known.to_unit(list(estimate.values()))
                sensitivity[place] += slope / known.derivative(found)[:, None]
        if not (np.isfinite(shift).all() and np.isfinite(sensitivity).all()):
            return discrepancy
        return replace(discrepancy, around=size, shift=shift, sensitivity=sensitivity)

    def _refitted(
        self,
        calibration: Calibration,
        effect: Effect,
        own: Mapping[str, float],
        start: Mapping[str, float],
        search: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Estimates (k,) of a stage with the effect at its ``own`` values, minus their derivative by its size (k, q).

        From a start near the minimum, which is kept without ``search``; nan where the stage cannot be simulated or the
        derivatives are dependent. Without ``search`` 0 for a size that the stage would not feel over its whole range.
        """
        stage = calibration.problem
        names, model = stage.space.names, with_effects(stage.model, effect)
        system, simulator = self.simulators.simulator(
            model, experiments_of(stage, (effect,)), (*names, *effect.size), _STEPS
        )
        layout = ParameterLayout(system.parameters, ParameterSpace(()), {**stage.layout.fixed, **start, **own})

        @lru_cache(maxsize=4)
        def rows(steps: int, point: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
            """Whitened residual (m,) and minus its derivative by the stage's parameters and the size, (m, k + q)."""
            here = layout.with_fixed(dict(zip(names, point, strict=True)))
            residuals, slopes = [], []
            outputs = simulator.with_steps(steps).sensitivities(here.full(np.zeros((1, 0))))
            for weight, (test, y) in zip(stage.noise.weights, objective_pairs(stage.experiments), strict=True):
                experiment, (output, slope) = stage.experiments[test], outputs[test]
                scale = np.sqrt(weight * experiment.weights[:, y])
                residuals.append(scale * (experiment.measured[:, y] - output[0, :, y]))
                slopes.append(scale[:, None] * slope[0, :, y])
            return np.concatenate(residuals), np.concatenate(slopes)

        point = np.array([start[name] for name in names])
        varied = (*stage.space.parameters, *ParameterSpace(effect.parameters).subset(effect.size).parameters)
        ranges = np.array([parameter.upper - parameter.lower for parameter in varied])
        steps = _enough_steps(ranges, lambda steps: rows(steps, tuple(point.tolist()))) if model.dynamic else _STEPS

        # trial steps may leave what can be simulated
        with suppress(ValueError, np.linalg.LinAlgError), np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            if search:
                point = least_squares(
                    lambda x: rows(steps, tuple(x))[0],
                    point,
                    lambda x: -rows(steps, tuple(x))[1][:, : len(names)],
                    x_scale="jac",
                    max_nfev=_EVALUATIONS,
                ).x
            # LAPACK would print of what is not finite
            slopes = np.asarray_chkfinite(rows(steps, tuple(point))[1])
            sensitivity, _, rank, _ = np.linalg.lstsq(slopes[:, : len(names)], slopes[:, len(names) :])
            if rank == len(names):
                felt = np.linalg.norm(slopes, axis=0) * ranges > _OUTPUT_CHANGE
                return point, np.where(felt[len(names) :] | search, sensitivity, 0.0)
        return np.full(len(names), np.nan), np.full((len(names), len(effect.size)), np.nan)


def _needs_more_than_a_record(effect: Effect) -> bool:
    """Whether an effect needs the time or conditions of a test, beside what its record's time axis tells.

    Such an effect acts on dynamic tests.
    """
    return bool(effect.inputs or {*effect.conditions} - {SAMPLE_INTERVAL, RECORD_LENGTH})


def _enough_steps(ranges: FloatArray, rows: Callable[[int], tuple[FloatArray, FloatArray]]) -> int:
    """As many as residual and derivatives by parameters with these ``ranges`` need."""

    def change(coarse: FloatArray, fine: FloatArray) -> float:
        residual, *slopes = np.linalg.norm(fine - coarse, axis=0)
        allowed = _SENSITIVITY_CHANGE * np.linalg.norm(fine, axis=0)[1:] + _OUTPUT_CHANGE / ranges
        return float(max(residual / _OUTPUT_CHANGE, np.max(slopes / allowed)))

    taken, _ = each_with_enough_steps(
        lambda steps, _: clipped(np.column_stack(rows(steps)))[None], change, 1.0, 1, _STEPS
    )
    return int(taken[0])
