"""Local refinement: a batched Levenberg-Marquardt method with exact gradients, inside the unit cube."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.optimize.box_minimum import box_minimum
from mofit.optimize.local_minima import Closeness, Refined, Status, Values, close_pairs
from mofit.optimize.trust_region_step import box_step, pressed, scaled_gradient

Evaluate = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Points (N, d) of the unit cube to value (N,), gradient (N, d), Gauss-Newton Hessian (N, d, d)."""
EvaluateEach = Callable[[FloatArray, NDArray[np.int64]], tuple[FloatArray, FloatArray, FloatArray]]
"""The same where each start has a function of its own; the second argument (N,) names the start of each point."""
GoOn = Callable[[FloatArray, FloatArray], NDArray[np.bool_]]
"""Values (K,) after an iteration, and by how much a Newton step in the box lowers them by the derivatives (K,), of all
starts: which are worth another one. The values of starts that cannot be evaluated are nan."""


@dataclass(frozen=True)
class RefineSettings:
    """Settings of `refine` and `minimise_each`. Values are in nats (the function is a negative log posterior)."""

    max_iterations: int = 100
    """Gauss-Newton needs about 10 near a minimum; curved valleys need tens."""
    gradient_tolerance: float = 1e-4
    """Largest scaled gradient component at a minimum: 1e-4 posterior standard deviations is far below any use."""
    decrease_tolerance: float = 1e-7
    """Predicted decrease of a Newton step, in nats, at a minimum: 4e-4 standard deviations, also along correlations."""
    stall_tolerance: float = 1e-3
    """Where rounding stops all progress, a predicted decrease (nats) below this still counts as converged: the point
    is within 0.05 standard deviations of the minimum."""
    damping: float = 1e-3
    """First Levenberg-Marquardt damping relative to the curvature (Nielsen 1999 gives 1e-3 for fair starts)."""
    least_damping: float = 1e-9
    """Keeps singular Hessians solvable."""
    most_damping: float = 1e12
    """Past this a start has stalled."""
    longest_step: float = 0.25
    """Largest move of a coordinate per step, in box widths: a longer one leaves the basin."""
    until: float = math.inf
    """Time of `time.monotonic` at which starts end where they are."""
    merge: Closeness | None = field(default_factory=Closeness)
    """A start this close to a better one is merged with it: it would end in the same minimum. None follows every start
    to its end."""
    lanes: int = 1
    """Points that are evaluated together as fast as one: where fewer starts are active, each tries several dampings at
    once. In a curved valley a single damping rises and falls for many steps."""
    dampings: tuple[float, ...] = (1.0, 16.0, 1 / 16, 256.0)
    """Those dampings, relative to the expected one."""
    accept: float = 1e-4
    """Least ratio of actual to predicted decrease (Nocedal and Wright 2006, algorithm 4.1: any value in (0, 1/4))."""


@dataclass(frozen=True)
class _State:
    """K starts on their way."""

    points: FloatArray
    values: FloatArray
    gradients: FloatArray
    hessians: FloatArray
    damping: FloatArray
    growth: FloatArray
    active: NDArray[np.bool_]
    converged: NDArray[np.bool_]
    given_up: NDArray[np.bool_]
    representative: NDArray[np.int64]  # the start that a merged start shares its end with; itself for the others
    evaluations: int


def refine(
    evaluate: Evaluate,
    starts: ArrayLike,
    settings: RefineSettings | None = None,
    values: Values | None = None,
    go_on: GoOn | None = None,
) -> Refined:
    r"""Minimise a function from every start, all starts in one call per iteration.

    Each iteration solves the damped Gauss-Newton model in the box (`box_step`), accepts the step if the value falls by
    a fraction of the predicted decrease, and sets the damping from that ratio :math:`\varrho` (Nielsen):
    :math:`\lambda \leftarrow \lambda \max(1/3, 1 - (2\varrho - 1)^3)` after a success, else
    :math:`\lambda \leftarrow \nu\lambda, \nu \leftarrow 2\nu`. A trial that returns nan is rejected like any other:
    the damping grows, the step shrinks. A start that comes close to a better one is merged with it.

    Parameters
    ----------
    evaluate
        A smooth negative log posterior with its exact gradient and a positive semi-definite Hessian.
    starts
        Points of the unit cube, shape (K, d); clipped to it.
    settings
        Tolerances and limits.
    values
        The values alone, where derivatives cost far more: then these are taken only where a step is accepted.
    go_on
        Asked after every iteration; starts that are not worth another one end there, as at the limit of iterations.

    Raises
    ------
    InputError
        If no start can be evaluated.

    References
    ----------
    Nielsen: Damping parameter in Marquardt's method (1999). Nocedal, Wright: Numerical Optimization (2006), chapters 4,
    10 and 16.
    """
    found = _minimise(lambda points, _: evaluate(points), starts, settings or RefineSettings(), values, go_on)
    if set(found.status) == {"failed"}:
        message = f"none of the {len(found.points)} start points could be evaluated"
        raise InputError.of("refine", message, "Check the model, or widen the search")
    return found


def minimise_each(evaluate: EvaluateEach, starts: ArrayLike, settings: RefineSettings) -> Refined:
    """As `refine`, but each start has a function of its own, none is merged, and all may fail."""
    return _minimise(evaluate, starts, replace(settings, merge=None), None)


def _minimise(
    evaluate: EvaluateEach,
    starts: ArrayLike,
    settings: RefineSettings,
    judge: Values | None,
    go_on: GoOn | None = None,
) -> Refined:
    state = _begin(evaluate, np.clip(np.atleast_2d(np.asarray(starts, dtype=float)), 0.0, 1.0), settings)
    for _ in range(settings.max_iterations):
        state = _given_up(_settle(state, settings), settings, go_on)
        if not state.active.any() or time.monotonic() > settings.until:
            break
        state = _advance(evaluate, state, settings, judge)
    return _result(_settle(state, settings), settings)


def _begin(evaluate: EvaluateEach, points: FloatArray, settings: RefineSettings) -> _State:
    values, gradients, hessians, usable = _evaluated(evaluate, points, np.arange(len(points)))
    count = len(points)
    return _State(
        points=points,
        values=np.where(usable, values, np.nan),
        gradients=gradients,
        hessians=hessians,
        damping=np.full(count, settings.damping),
        growth=np.full(count, 2.0),
        active=usable,
        converged=np.zeros(count, dtype=bool),
        given_up=np.zeros(count, dtype=bool),
        representative=np.arange(count),
        evaluations=count,
    )


def _evaluated(
    evaluate: EvaluateEach, points: FloatArray, rows: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Value, gradient and Hessian, and which of them are usable; the others hold zeros for the derivatives."""
    values, gradients, hessians = evaluate(points, rows)
    usable = np.isfinite(values) & np.isfinite(gradients).all(axis=1) & np.isfinite(hessians).all(axis=(1, 2))
    gradients = np.where(usable[:, None], gradients, 0.0)
    hessians = np.where(usable[:, None, None], hessians, 0.0)
    return np.asarray(values, dtype=float), gradients, hessians, usable


def _evaluated_where(
    evaluate: EvaluateEach, points: FloatArray, rows: NDArray[np.int64], where: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """As `_evaluated`, of some of the points; the others count as not usable."""
    if where.all():
        return _evaluated(evaluate, points, rows)
    (count, d), usable = points.shape, np.zeros(len(points), dtype=bool)
    values, gradients, hessians = np.full(count, np.nan), np.zeros((count, d)), np.zeros((count, d, d))
    if where.any():
        found = _evaluated(evaluate, points[where], rows[where])
        values[where], gradients[where], hessians[where], usable[where] = found
    return values, gradients, hessians, usable


def _predicted_decrease(state: _State, settings: RefineSettings, reach: float) -> FloatArray:
    """What an undamped step that moves no coordinate farther than ``reach`` would gain, in nats, shape (K,)."""
    least = np.full(len(state.points), settings.least_damping)
    return box_minimum(state.points, state.gradients, state.hessians, least, reach)[1]


def _settle(state: _State, settings: RefineSettings) -> _State:
    """Deactivate the starts that have converged, stalled or merged."""
    gain = _predicted_decrease(state, settings, settings.longest_step)
    flat = scaled_gradient(state.points, state.gradients, state.hessians) <= settings.gradient_tolerance
    there = state.active & flat & (gain <= settings.decrease_tolerance)
    stalled = state.active & ~there & (state.damping > settings.most_damping)
    near = stalled & (gain <= settings.stall_tolerance)
    settled = replace(state, active=state.active & ~there & ~stalled, converged=state.converged | there | near)
    return settled if settings.merge is None else _merged(settled, settings.merge)


def _given_up(state: _State, settings: RefineSettings, go_on: GoOn | None) -> _State:
    """Deactivate the starts that are not worth another iteration."""
    if go_on is None:
        return state
    hopeless = state.active & ~go_on(state.values, _predicted_decrease(state, settings, reach=1.0))
    return replace(state, active=state.active & ~hopeless, given_up=state.given_up | hopeless)


def _merged(state: _State, closeness: Closeness) -> _State:
    """Deactivate the starts that are close to a better one, which represents them from now on."""
    close = close_pairs(state.points, state.values, state.hessians, closeness)
    close &= (state.active | state.converged)[:, None]  # a stalled point represents nobody
    merged = state.active & close.any(axis=0)
    best = np.argmin(np.where(close, state.values[:, None], np.inf), axis=0)
    return replace(state, active=state.active & ~merged, representative=np.where(merged, best, state.representative))


def _advance(evaluate: EvaluateEach, state: _State, settings: RefineSettings, judge: Values | None) -> _State:
    """One step of every active start, the best of those tried."""
    rows = np.flatnonzero(state.active)
    tried = np.outer(state.damping[rows], settings.dampings[: max(settings.lanes // len(rows), 1)])
    source, flat = np.repeat(rows, tried.shape[1]), tried.ravel()
    here, value = state.points[source], state.values[source]
    step, fall = box_step(here, state.gradients[source], state.hessians[source], flat, settings.longest_step)
    trial = np.clip(here + step, 0.0, 1.0)
    falls = np.ones(len(trial), dtype=bool) if judge is None else value - judge(trial) > settings.accept * fall
    values, gradients, hessians, usable = _evaluated_where(evaluate, trial, source, falls)
    ratio = np.where(usable & (fall > 0), (value - values) / np.where(fall > 0, fall, 1.0), -1.0)
    good = ratio > settings.accept

    lowest = np.argmin(np.where(good, values, np.inf).reshape(tried.shape), axis=1)
    best = np.arange(len(rows)) * tried.shape[1] + lowest
    trial, values, gradients, hessians, ratio, good = (
        found[best] for found in (trial, values, gradients, hessians, ratio, good)
    )
    damping, growth = state.damping.copy(), state.growth.copy()
    shrink = np.maximum(1 / 3, 1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3)
    damping[rows] = np.where(good, shrink * flat[best], growth[rows] * tried.max(axis=1))
    damping = np.maximum(damping, settings.least_damping)
    growth[rows] = np.where(good, 2.0, 2 * growth[rows])

    def taken(old: FloatArray, new: FloatArray) -> FloatArray:
        changed = old.copy()
        changed[rows[good]] = new[good]
        return changed

    return replace(
        state,
        points=taken(state.points, trial),
        values=taken(state.values, values),
        gradients=taken(state.gradients, gradients),
        hessians=taken(state.hessians, hessians),
        damping=damping,
        growth=growth,
        evaluations=state.evaluations + len(source),
    )


def _result(state: _State, settings: RefineSettings) -> Refined:
    ends = state.representative
    while np.any(ends[ends] != ends):  # representatives may have merged with others later
        ends = ends[ends]

    rules = {
        "failed": np.isnan(state.values),
        "merged": ends != np.arange(len(ends)),
        "limit": state.active | state.given_up,
        "stalled": state.damping > settings.most_damping,
    }
    return Refined(
        points=state.points[ends],
        values=state.values[ends],
        gradients=state.gradients[ends],
        hessians=state.hessians[ends],
        converged=state.converged[ends],
        status=cast("tuple[Status, ...]", tuple(np.select(list(rules.values()), list(rules), "converged").tolist())),
        at_bound=pressed(state.points, state.gradients)[ends],
        evaluations=state.evaluations,
    )
