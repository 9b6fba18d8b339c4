"""Polishing start points with exact gradients: a batched, bounded Levenberg-Marquardt method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import InputError
from mofit.parameters import Array
from mofit.refine.closeness import Closeness, close_pairs
from mofit.refine.result import Refined, Status
from mofit.refine.step import box_step, pressed, scaled_gradient

Evaluate = Callable[[Array], tuple[Array, Array, Array]]
"""Points (N, d) of the unit cube to value (N,), gradient (N, d), Gauss-Newton Hessian (N, d, d)."""
Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, note)``."""


@dataclass(frozen=True)
class RefineSettings:
    """Settings of `refine`. Values are in nats (the function is a negative log posterior)."""

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
    reach: float = 0.25
    """Largest move of a coordinate per step, in box widths: a longer step leaves the basin it was meant to polish."""
    join: Closeness | None = field(default_factory=Closeness)
    """A start this close to a better one is not followed further: it would end in the same minimum, and starts by the
    dozen end in a few minima. None follows every start to its end."""
    lanes: int = 1
    """Points that are evaluated as fast together as one alone: where fewer starts are followed, each tries several
    dampings at once. In a curved valley a single one goes up and down for many steps."""
    accept: float = 1e-4
    """Least ratio of actual to predicted decrease (Nocedal and Wright 2006, algorithm 4.1: any value in (0, 1/4))."""


#: Dampings that are tried at once, relative to the one expected.
_TRIED = np.array([1.0, 16.0, 1 / 16, 256.0])


@dataclass(frozen=True)
class _State:
    """K starts on their way."""

    points: Array
    values: Array
    gradients: Array
    hessians: Array
    damping: Array
    growth: Array
    active: NDArray[np.bool_]
    converged: NDArray[np.bool_]
    leader: NDArray[np.int64]  # the start that a joined start follows; itself for the others
    evaluations: int


def refine(
    evaluate: Evaluate,
    starts: ArrayLike,
    settings: RefineSettings | None = None,
    progress: Progress | None = None,
) -> Refined:
    r"""Minimise from every start, all starts in one call per iteration.

    Each iteration solves the damped Gauss-Newton model in the box (`box_step`), accepts the step if the value falls by
    a fraction of what the model promised, and sets the damping from that ratio :math:`\varrho` (Nielsen):
    :math:`\lambda \leftarrow \lambda \max(1/3, 1 - (2\varrho - 1)^3)` after a success, else
    :math:`\lambda \leftarrow \nu\lambda, \nu \leftarrow 2\nu`. A trial that returns nan is a failure like any other:
    the damping grows, the step shrinks. A start that comes close to a better one joins it and shares its end.

    Parameters
    ----------
    evaluate
        The function: a smooth negative log posterior with its exact gradient and a positive semi-definite Hessian.
    starts
        Points of the unit cube, shape (K, d); clipped to it.
    settings
        Tolerances and limits.
    progress
        Called as ``progress(iteration, max_iterations, note)``.

    Raises
    ------
    InputError
        If no start can be evaluated.

    References
    ----------
    Nielsen: Damping parameter in Marquardt's method (1999). Nocedal, Wright: Numerical Optimization (2006), chapters 4,
    10 and 16.
    """
    settings = settings or RefineSettings()
    state = _begin(evaluate, np.clip(np.atleast_2d(np.asarray(starts, dtype=float)), 0.0, 1.0), settings)
    iteration = 0
    while iteration < settings.max_iterations:
        state = _settle(state, settings)
        if not state.active.any():
            break
        state = _advance(evaluate, state, settings)
        iteration += 1
        if progress is not None:
            note = f"{int(state.active.sum())} of {len(state.points)} starts active, best {np.nanmin(state.values):.6g}"
            progress(iteration, settings.max_iterations, note)
    return _result(_settle(state, settings), iteration, settings)


def _begin(evaluate: Evaluate, points: Array, settings: RefineSettings) -> _State:
    values, gradients, hessians, usable = _evaluated(evaluate, points)
    if not usable.any():
        raise InputError.of(
            "refine",
            f"none of the {len(points)} start points could be evaluated",
            "Check the model, or widen the search",
        )
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
        leader=np.arange(count),
        evaluations=count,
    )


def _evaluated(evaluate: Evaluate, points: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Value, gradient and Hessian, and which of them are usable; the others hold zeros for the derivatives."""
    values, gradients, hessians = evaluate(points)
    usable = np.isfinite(values) & np.isfinite(gradients).all(axis=1) & np.isfinite(hessians).all(axis=(1, 2))
    gradients = np.where(usable[:, None], gradients, 0.0)
    hessians = np.where(usable[:, None, None], hessians, 0.0)
    return np.asarray(values, dtype=float), gradients, hessians, usable


def _predicted_decrease(state: _State, settings: RefineSettings) -> Array:
    """What an undamped step would gain, in nats, shape (K,)."""
    least = np.full(len(state.points), settings.least_damping)
    return box_step(state.points, state.gradients, state.hessians, least, settings.reach)[1]


def _settle(state: _State, settings: RefineSettings) -> _State:
    """Retire the starts that have converged or stalled."""
    gain = _predicted_decrease(state, settings)
    flat = scaled_gradient(state.points, state.gradients, state.hessians) <= settings.gradient_tolerance
    there = state.active & flat & (gain <= settings.decrease_tolerance)
    stalled = state.active & ~there & (state.damping > settings.most_damping)
    near = stalled & (gain <= settings.stall_tolerance)
    settled = replace(state, active=state.active & ~there & ~stalled, converged=state.converged | there | near)
    return settled if settings.join is None else _joined(settled, settings.join)


def _joined(state: _State, closeness: Closeness) -> _State:
    """Retire the active starts that are close to a better one, which they follow from now on."""
    close = close_pairs(state.points, state.values, state.hessians, closeness)
    close &= (state.active | state.converged)[:, None]  # a stalled point leads nobody
    joins = state.active & close.any(axis=0)
    best = np.argmin(np.where(close, state.values[:, None], np.inf), axis=0)
    return replace(state, active=state.active & ~joins, leader=np.where(joins, best, state.leader))


def _advance(evaluate: Evaluate, state: _State, settings: RefineSettings) -> _State:
    """One step of every active start, the best of those tried."""
    rows = np.flatnonzero(state.active)
    tried = np.outer(state.damping[rows], _TRIED[: max(settings.lanes // len(rows), 1)])
    source, flat = np.repeat(rows, tried.shape[1]), tried.ravel()
    here, value = state.points[source], state.values[source]
    step, fall = box_step(here, state.gradients[source], state.hessians[source], flat, settings.reach)
    trial = np.clip(here + step, 0.0, 1.0)
    values, gradients, hessians, usable = _evaluated(evaluate, trial)
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

    def taken(old: Array, new: Array) -> Array:
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


def _result(state: _State, iterations: int, settings: RefineSettings) -> Refined:
    leader = state.leader
    while np.any(leader[leader] != leader):  # leaders may have joined others later
        leader = leader[leader]

    def status(row: int) -> Status:
        if np.isnan(state.values[row]):
            return "failed"
        if leader[row] != row:
            return "joined"
        if state.active[row]:
            return "limit"
        return "stalled" if state.damping[row] > settings.most_damping else "converged"

    return Refined(
        points=state.points[leader],
        values=state.values[leader],
        gradients=state.gradients[leader],
        hessians=state.hessians[leader],
        gradient_norms=scaled_gradient(state.points, state.gradients, state.hessians)[leader],
        converged=state.converged[leader],
        status=tuple(status(row) for row in range(len(state.points))),
        at_bound=pressed(state.points, state.gradients)[leader],
        evaluations=state.evaluations,
        iterations=iterations,
    )
