"""Descending from many points at once: projected BFGS with a capped step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array
from mofit.search.ledger import Ledger
from mofit.search.minima import End, Minima


@dataclass(frozen=True)
class PolishSettings:
    """Lengths are shares of the box."""

    first_step: float = 0.02
    """Length of the very first step, along the negative gradient; later ones know a typical curvature. A long one
    jumps out of the basin that it was meant to polish."""
    longest_step: float = 0.06
    """Cap on a step, for the same reason."""
    tolerance: float = 1.5e-3
    """A step shorter than this ends the descent: enough to tell basins apart."""
    decrease: float = 1e-4
    """Armijo's constant."""
    most_steps: int = 60
    """Trial points of one descent: a curved valley must not eat the budget."""


@dataclass(frozen=True)
class Descent:
    """What became of a start: its end, or None where it ran into a known minimum, and which one's neighbourhood."""

    minima: Minima
    end: End | None


@dataclass
class _Walker:
    """One start on its way."""

    minima: Minima
    row: int
    point: Array
    cost: float
    slope: Array
    inverse: Array
    move: Array
    scale: float = 1.0
    trials: int = 0
    steepest: float = 0.0
    doubted: bool = False
    state: str = "going"  # going, there, known


def descend(
    ledger: Ledger, starts: Sequence[tuple[Minima, Array, Array | None]], settings: PolishSettings, repel: float
) -> list[Descent]:
    """Polish starts together, one batch of trial points per iteration.

    Parameters
    ----------
    ledger
        Evaluates; the descents end where its budget does.
    starts
        Scalarisation, point (d,), and the inverse Hessian to begin with (None: the typical one of known minima).
    settings
        Step lengths.
    repel
        A walker that comes within ``repel`` times the exclusion radius of a known minimum, or of a better walker's
        point, is given up: it is predicted to end there. 0 follows all to their ends.
    """
    if not starts or ledger.gradients_left == 0:
        return []
    walkers = _begin(ledger, starts, settings)
    while True:
        going = [walker for walker in walkers if walker.state == "going"]
        if not going or ledger.gradients_left == 0:
            break
        trials = np.stack([np.clip(w.point + w.scale * w.move, 0.0, 1.0) for w in going])
        rows, values, slopes = ledger.differentiate(trials)
        for k, row in enumerate(rows):
            _advance(going[k], int(row), trials[k], values[k], slopes[k], settings)
        if repel > 0:
            _give_up(walkers, repel)
    return [Descent(w.minima, End(w.row, w.point, w.cost, w.inverse) if w.state != "known" else None) for w in walkers]


def _begin(
    ledger: Ledger, starts: Sequence[tuple[Minima, Array, Array | None]], settings: PolishSettings
) -> list[_Walker]:
    rows, values, slopes = ledger.differentiate(np.stack([point for _, point, _ in starts]))
    walkers = []
    for k, row in enumerate(rows):
        minima, point, inverse = starts[k]
        cost, slope = float(minima.cost(values[k])), minima.slope(slopes[k])
        if not np.isfinite(cost) or not np.all(np.isfinite(slope)):
            continue
        walker = _Walker(minima, int(row), point, cost, slope, np.eye(len(point)), np.zeros_like(point))
        if inverse is None:
            walker.inverse = _borrowed(walker, settings)
        else:
            walker.inverse = inverse
        _aim(walker, settings)
        walkers.append(walker)
    return walkers


def _borrowed(walker: _Walker, settings: PolishSettings) -> Array:
    """An inverse Hessian to begin with: the typical one, if it takes a step worth the name, else the gradient's."""
    typical = walker.minima.typical_inverse()
    if typical is not None and np.linalg.norm(typical @ walker.slope) > 2 * settings.tolerance:
        return typical
    length = max(float(np.linalg.norm(walker.slope)), np.finfo(float).tiny)
    return np.eye(len(walker.point)) * settings.first_step / length


def _free(walker: _Walker) -> NDArray[np.bool_]:
    """Coordinates that are not pressed against a bound."""
    pressed = ((walker.point <= 0) & (walker.slope > 0)) | ((walker.point >= 1) & (walker.slope < 0))
    return ~pressed


#: A descent that stops where the gradient is more than this share of its steepest is sent on once.
_FLAT = 0.2


def _aim(walker: _Walker, settings: PolishSettings) -> None:
    """Choose the next move: quasi-Newton on the free coordinates, no longer than the cap; none ends the descent."""
    free = _free(walker)
    move = np.zeros_like(walker.point)
    move[free] = -walker.inverse[np.ix_(free, free)] @ walker.slope[free]
    length = float(np.linalg.norm(move))
    steepness = float(np.linalg.norm(walker.slope[free]))
    walker.steepest = max(walker.steepest, steepness)
    if not length > settings.tolerance:
        if walker.doubted or not steepness > _FLAT * walker.steepest:
            walker.state = "there"
        else:  # a curvature met on the way stops it on a slope
            walker.doubted = True
            walker.inverse = _borrowed(walker, settings)
            _aim(walker, settings)
        return
    walker.move = move * min(1.0, settings.longest_step / length)
    walker.scale = 1.0


def _advance(walker: _Walker, row: int, trial: Array, values: Array, slopes: Array, settings: PolishSettings) -> None:
    """Take the trial point if it is lower, else shorten the step."""
    walker.trials += 1
    step = trial - walker.point
    cost, slope = float(walker.minima.cost(values)), walker.minima.slope(slopes)
    expected = float(walker.slope @ step)
    usable = bool(np.isfinite(cost) and np.all(np.isfinite(slope)))
    length = float(np.linalg.norm(step))
    if usable and cost <= walker.cost + settings.decrease * min(expected, 0.0):
        walker.inverse = _updated(walker.inverse, step, slope - walker.slope)
        walker.row, walker.point, walker.cost, walker.slope = row, trial, cost, slope
        if length < settings.tolerance:
            walker.state = "there"
        else:
            _aim(walker, settings)
    else:
        bend = 2 * (cost - walker.cost - expected) if usable else np.inf
        shorter = -expected / bend if bend > 0 and expected < 0 else 0.1
        walker.scale *= float(np.clip(shorter, 0.1, 0.5))
        if length * walker.scale < settings.tolerance * 0.1 or length == 0:
            walker.state = "there"
    if walker.trials >= settings.most_steps:
        walker.state = "there"


def _updated(inverse: Array, step: Array, change: Array) -> Array:
    """BFGS update of the inverse Hessian; skipped where the function is not convex along the step."""
    product = float(step @ change)
    if product <= 1e-10 * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse
    left = np.eye(len(step)) - np.outer(step, change) / product
    return np.asarray(left @ inverse @ left.T + np.outer(step, step) / product)


def _give_up(walkers: list[_Walker], repel: float) -> None:
    """Stop walkers that are predicted to end in a known minimum or where a better walker is."""
    for walker in walkers:
        if walker.state != "going":
            continue
        radius = repel * walker.minima.exclusion
        if walker.minima.distance(walker.point) < radius or any(
            other.minima is walker.minima
            and other is not walker
            and other.state != "known"
            and other.cost <= walker.cost
            and np.linalg.norm(other.point - walker.point) < radius
            for other in walkers
        ):
            walker.state = "known"
