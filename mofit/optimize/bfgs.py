"""Descending from many points at once: projected BFGS with a capped step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.minima_archive import Endpoint, MinimaArchive


@dataclass(frozen=True)
class DescentSettings:
    """Settings of `descend`. Lengths are shares of the box."""

    first_step: float = 0.02
    """Length of the very first step, along the negative gradient; later ones use a typical curvature. A long one leaves
    the basin."""
    longest_step: float = 0.06
    """Cap on a step, for the same reason."""
    tolerance: float = 1.5e-3
    """A step shorter than this ends the descent: enough to distinguish basins."""
    decrease: float = 1e-4
    """Armijo's constant."""
    most_steps: int = 60
    """Trial points of one descent: a curved valley must not use up the budget."""
    steep: float = 0.2
    """A descent that stops where the gradient exceeds this share of its steepest is restarted once: curvature met on
    the way made its steps short."""


@dataclass
class _Start:
    """One start on its way."""

    archive: MinimaArchive
    row: int
    point: FloatArray
    cost: float
    gradient: FloatArray
    inverse: FloatArray
    move: FloatArray
    scale: float = 1.0
    trials: int = 0
    steepest: float = 0.0
    restarted: bool = False
    smooth: bool = True
    state: Literal["active", "ended", "rejected"] = "active"


def descend(
    log: EvaluationLog,
    starts: Sequence[tuple[MinimaArchive, FloatArray, FloatArray | None]],
    settings: DescentSettings,
    tabu: float,
) -> list[tuple[MinimaArchive, Endpoint]]:
    """Descend from several starts together, one batch of trial points per iteration.

    Parameters
    ----------
    log
        Evaluates; the descents end where its budget does.
    starts
        Scalarisation, point (d,), and the inverse Hessian to begin with (None: the typical one of known minima).
    settings
        Step lengths.
    tabu
        A start that comes within this share of the tabu radius of a known minimum, or of a better start's point, is
        rejected: it would probably end there. 0 follows all to their ends.

    Returns
    -------
    Scalarisation and end of every start that was not rejected.
    """
    if not starts or log.gradients_left == 0:
        return []
    running = _begin(log, starts, settings)
    while True:
        active = [start for start in running if start.state == "active"]
        if not active or log.gradients_left == 0:
            break
        trials = np.stack([np.clip(s.point + s.scale * s.move, 0.0, 1.0) for s in active])
        rows, values, slopes = log.differentiate(trials)
        for k, row in enumerate(rows):
            _advance(active[k], int(row), trials[k], values[k], slopes[k], settings)
        if tabu > 0:
            _reject(running, tabu)
    return [
        (s.archive, Endpoint(s.row, s.point, s.cost, s.inverse, s.state == "ended", smooth=s.smooth))
        for s in running
        if s.state != "rejected"
    ]


def _begin(
    log: EvaluationLog, starts: Sequence[tuple[MinimaArchive, FloatArray, FloatArray | None]], settings: DescentSettings
) -> list[_Start]:
    rows, values, slopes = log.differentiate(np.stack([point for _, point, _ in starts]))
    running = []
    for k, row in enumerate(rows):
        archive, point, inverse = starts[k]
        cost, gradient = float(archive.cost(values[k])), archive.gradient(slopes[k])
        if not np.isfinite(cost) or not np.all(np.isfinite(gradient)):
            continue
        start = _Start(archive, int(row), point, cost, gradient, np.eye(len(point)), np.zeros_like(point))
        if inverse is None:
            start.inverse = _first_inverse(start, settings)
        else:
            start.inverse = inverse
        _aim(start, settings)
        running.append(start)
    return running


def _first_inverse(start: _Start, settings: DescentSettings) -> FloatArray:
    """First inverse Hessian: the typical one, if its step exceeds the tolerance, else that of a step of set length."""
    typical = start.archive.typical_inverse()
    if typical is not None and np.linalg.norm(typical @ start.gradient) > 2 * settings.tolerance:
        return typical
    length = max(float(np.linalg.norm(start.gradient)), np.finfo(float).tiny)
    return np.eye(len(start.point)) * settings.first_step / length


def _free(start: _Start) -> NDArray[np.bool_]:
    """Coordinates that are not pressed against a bound."""
    pressed = ((start.point <= 0) & (start.gradient > 0)) | ((start.point >= 1) & (start.gradient < 0))
    return ~pressed


def _aim(start: _Start, settings: DescentSettings) -> None:
    """Set the next move: quasi-Newton on the free coordinates, capped; a short one ends the descent."""
    free = _free(start)
    move = np.zeros_like(start.point)
    move[free] = -start.inverse[np.ix_(free, free)] @ start.gradient[free]
    length = float(np.linalg.norm(move))
    steepness = float(np.linalg.norm(start.gradient[free]))
    start.steepest = max(start.steepest, steepness)
    if not length > settings.tolerance:
        if start.restarted or not steepness > settings.steep * start.steepest:
            start.state = "ended"
        else:
            start.restarted = True
            start.inverse = _first_inverse(start, settings)
            _aim(start, settings)
        return
    start.move = move * min(1.0, settings.longest_step / length)
    start.scale = 1.0


def _advance(
    start: _Start, row: int, trial: FloatArray, values: FloatArray, slopes: FloatArray, settings: DescentSettings
) -> None:
    """Take the trial point if it is lower, else shorten the step."""
    start.trials += 1
    step = trial - start.point
    cost, gradient = float(start.archive.cost(values)), start.archive.gradient(slopes)
    expected = float(start.gradient @ step)
    usable = bool(np.isfinite(cost) and np.all(np.isfinite(gradient)))
    length = float(np.linalg.norm(step))
    if usable and cost <= start.cost + settings.decrease * min(expected, 0.0):
        start.inverse = _updated(start.inverse, step, gradient - start.gradient)
        start.row, start.point, start.cost, start.gradient = row, trial, cost, gradient
        if length < settings.tolerance:
            start.state = "ended"
        else:
            _aim(start, settings)
    else:
        bend = 2 * (cost - start.cost - expected) if usable else np.inf
        shorter = -expected / bend if bend > 0 and expected < 0 else 0.1
        start.scale *= float(np.clip(shorter, 0.1, 0.5))
        if length * start.scale < settings.tolerance * 0.1 or length == 0:
            start.state, start.smooth = "ended", bool(shorter < 0.25)  # else the rise is less than the promised fall
    if start.trials >= settings.most_steps:
        start.state = "ended"


def _updated(inverse: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """BFGS update of the inverse Hessian; skipped where the function is not convex along the step."""
    product = float(step @ change)
    if product <= 1e-10 * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse
    left = np.eye(len(step)) - np.outer(step, change) / product
    return np.asarray(left @ inverse @ left.T + np.outer(step, step) / product)


def _reject(running: list[_Start], tabu: float) -> None:
    """Stop starts that would probably end in a known minimum or where a better start does."""
    for start in running:
        if start.state != "active":
            continue
        radius = tabu * start.archive.tabu_radius
        if start.archive.distance(start.point) < radius or any(
            other.archive is start.archive
            and other is not start
            and other.state != "rejected"
            and other.cost <= start.cost
            and np.linalg.norm(other.point - start.point) < radius
            for other in running
        ):
            start.state = "rejected"
