"""An effect as an explanation: in the dynamic tests alone, or in the calibration tests too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mofit.calibration import Calibration
from mofit.diagnosis.steps import tamed, with_enough_steps
from mofit.diagnosis.workshop import Workshop
from mofit.kernel import Simulator
from mofit.model import Effect, why_not, with_effects
from mofit.parameters import ParameterSpace

Array = NDArray[np.float64]

#: Runge-Kutta steps per sample in the stages' tests, which are slow.
_STEPS = 4
#: What halving the steps of an effect with states may change: of all white samples together, and relatively of slopes.
_STEP_ERROR, _SLOPE_ERROR = 0.3, 0.03
#: Most evaluations of a stage that is fitted anew with an effect.
_EVALUATIONS = 30


@dataclass(frozen=True)
class Cause:
    r"""An effect, where its grid stands, and what it did to the calibration.

    With the effect's size a the stages would have found :math:`m + \Delta - b \, (a - a_0)` in place of m.

    Parameters
    ----------
    effect
        The effect.
    point
        Values of the parameters that mean nothing without it.
    around
        Size a_0 at which the stages were looked at, (q,).
    moved
        :math:`\Delta`, in the unit coordinates of the problem's space, (d,).
    carried
        b, per unit of the size, (d, q); zero where the calibration tests did not have the effect.
    """

    effect: Effect
    point: Mapping[str, float]
    around: Array
    moved: Array
    carried: Array

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def everywhere(self) -> bool:
        """Whether the calibration tests had the effect too."""
        return bool(np.any(self.carried))


def causes(
    effect: Effect, space: ParameterSpace, calibrations: Sequence[Calibration], workshop: Workshop
) -> list[Cause]:
    """The effect at every point of its grid, in the dynamic tests alone and, where it moves the stages, in all."""
    nothing = np.array([effect.neutral[name] for name in effect.size])
    dynamic = [
        Cause(effect, point, nothing, np.zeros(len(space)), np.zeros((len(space), len(effect.size))))
        for point in effect.grid_points
    ]
    everywhere = [
        recalibrated(cause, {**effect.neutral, **cause.point}, space, calibrations, workshop) for cause in dynamic
    ]
    return [*dynamic, *(cause for cause in everywhere if cause.everywhere)]


def recalibrated(
    cause: Cause,
    values: Mapping[str, float],
    space: ParameterSpace,
    calibrations: Sequence[Calibration],
    workshop: Workshop,
) -> Cause:
    """The cause with the stages fitted anew, the effect having these values in their tests.

    They start from what ``values`` say of their own parameters, or where they had ended; without effect they stay
    there. Where an effect is so large that a stage's tests cannot be simulated or fitted with it, the cause stays as it
    is.
    """
    effect, size = cause.effect, np.array([values[name] for name in cause.effect.size])
    moved, carried = np.zeros(len(space)), np.zeros((len(space), len(effect.size)))
    neutral = all(values[name] == effect.neutral[name] for name in effect.size)
    own = {parameter.name: values[parameter.name] for parameter in effect.parameters}
    for calibration in calibrations:
        stage = calibration.problem
        # effects that need the time or conditions of a test act on dynamic tests
        if why_not(effect, stage.model) is not None or effect.inputs or effect.conditions:
            continue
        place = [space.index(name) for name in stage.space.names]
        known = space.subset(stage.space.names)
        ended = calibration.values
        start = ended if neutral else {name: values.get(name, ended[name]) for name in ended}
        found, slope = _refitted(calibration, effect, own, start, 0 if neutral else _EVALUATIONS, workshop)
        # a stage that ran away may have left the logarithms' domain
        with np.errstate(invalid="ignore"):
            moved[place] += known.to_unit(found) - known.to_unit(list(ended.values()))
            carried[place] += slope / known.slope(found)[:, None]
    if not (np.isfinite(moved).all() and np.isfinite(carried).all()):
        return cause
    return replace(cause, around=size, moved=moved, carried=carried)


def _refitted(
    calibration: Calibration,
    effect: Effect,
    own: Mapping[str, float],
    start: Mapping[str, float],
    evaluations: int,
    workshop: Workshop,
) -> tuple[Array, Array]:
    """Estimates of a stage with the effect at its ``own`` values, (k,), and minus their derivative by its size, (k, q).

    From a start near the minimum; nan where it cannot be simulated or the derivatives are dependent.
    """
    stage = calibration.problem
    names = stage.space.names
    system, simulator = workshop.simulator(
        with_effects(stage.model, effect), stage.drives, (*names, *effect.size), _STEPS
    )

    def simulated(at: Simulator, point: Sequence[float]) -> tuple[Array, Array]:
        """White residual (m,) and minus its derivative by the stage's parameters and the size, (m, k + q)."""
        here = {**stage.fixed, **own, **dict(zip(names, point, strict=True))}
        stored = at.sensitivities(np.array([[here[name] for name in system.parameters]]))
        residuals, slopes = [], []
        for drive, weight, (output, slope) in zip(stage.drives, stage.noise.weights, stored, strict=True):
            scale = np.sqrt(weight * drive.weights)
            residuals.append((scale * (drive.measured - output[0])).ravel())
            slopes.append((scale[..., None] * slope[0]).reshape(-1, slope.shape[-1]))
        return np.concatenate(residuals), np.concatenate(slopes)

    point = np.array([start[name] for name in names])
    if effect.states:
        simulator = _fine_enough(simulator, lambda at: simulated(at, point.tolist()))

    @lru_cache(maxsize=1)
    def rows(point: tuple[float, ...]) -> tuple[Array, Array]:
        return simulated(simulator, point)

    # trial steps may leave what can be simulated
    with suppress(ValueError, np.linalg.LinAlgError), np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if evaluations:
            point = least_squares(
                lambda x: rows(tuple(x))[0],
                point,
                lambda x: -rows(tuple(x))[1][:, : len(names)],
                x_scale="jac",
                max_nfev=evaluations,
            ).x
        # LAPACK would print of what is not finite
        slopes = np.asarray_chkfinite(rows(tuple(point))[1])
        carried, _, rank, _ = np.linalg.lstsq(slopes[:, : len(names)], slopes[:, len(names) :])
        if rank == len(names):
            return point, np.asarray(carried, dtype=np.float64)
    return np.full(len(names), np.nan), np.full((len(names), len(effect.size)), np.nan)


def _fine_enough(simulator: Simulator, rows: Callable[[Simulator], tuple[Array, Array]]) -> Simulator:
    """The simulator with as many steps as residual and slopes need: a stage that is unstable says nothing."""

    def both(at: Simulator) -> Array:
        residual, slopes = rows(at)
        return tamed(np.column_stack([residual, slopes]))

    def change(coarse: Array, fine: Array) -> float:
        residual, *slopes = np.linalg.norm(fine - coarse, axis=0)
        sizes = np.linalg.norm(fine, axis=0)[1:] + np.finfo(float).tiny
        return float(max(residual / _STEP_ERROR, np.max(slopes / sizes) / _SLOPE_ERROR))

    return with_enough_steps(simulator, both, change, 1.0, _STEPS)[0]
