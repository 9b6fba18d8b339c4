"""A curved valley, followed from its minimum to its ends: where the chains of a mode start and what they propose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mofit._typing import FloatArray
from mofit.identification.combinations import UNDETERMINED
from mofit.sampling import StudentTMixture

Terms = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Points (N, d) to negative log posterior (N,), gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""

#: Longest and shortest step along the valley, in box widths.
LONGEST, SHORTEST = 1 / 32, 1 / 1024
#: Steps to each side at most.
MOST = 200
#: Most that the valley bends away within a step, in standard deviations across it: components then overlap.
SAG = 0.7
#: Nats above the minimum at which the valley ends: a mode has one part in twenty thousand of its mass beyond.
END = 10.0
#: Newton steps back to the bottom of the valley at most, and the fall in nats at which they end.
CORRECTIONS, SETTLED = 12, 1e-3
#: Least cosine between directions of the path that counts as straight: one Gaussian does.
STRAIGHT = 0.95
#: Degrees of freedom of the proposal.
FREEDOM = 5.0


def along_valley(terms: Terms, point: FloatArray, hessian: FloatArray) -> StudentTMixture | None:
    r"""A mixture along the valley through a minimum; None if the data determine all directions there or it is straight.

    From the minimum, steps along the direction that the data do not determine, in which the Hessian H is least curved;
    after each, Newton steps across it lead back to the bottom. Each place s of the path is a component of weight

    .. math:: w_s \propto \Delta_s e^{-f_s} |B^T H_s B|^{-1/2}, \quad S_s = \Delta_s^2 t t^T + B (B^T H_s B)^{-1} B^T

    with t the direction of the path, :math:`\Delta` its step, shorter where it bends, and B a basis across it. It
    covers a sum of two positive parameters on log scales, whose valley has a bend and two arms of a thousandth of the
    box.

    Parameters
    ----------
    terms
        Of the posterior.
    point, hessian
        Of the minimum, in unit coordinates.

    References
    ----------
    Allgower and Georg, Introduction to Numerical Continuation Methods (2003): predictor and corrector.
    """
    curvatures, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    if len(point) < 2 or np.count_nonzero(curvatures < UNDETERMINED**-2) != 1:
        return None
    (value,), _, (own,) = terms(point[None])
    here = (point, vectors[:, 0], float(value), own, LONGEST)
    path = [*_side(terms, here, -1.0)[::-1], here, *_side(terms, here, 1.0)]
    directions = np.array([place[1] for place in path])
    if np.abs(directions @ directions.T).min() > STRAIGHT:
        return None
    logs, scales = zip(*(_component(*place[1:]) for place in path), strict=True)
    weights = np.exp(np.array(logs) - max(logs))
    kept = weights > np.exp(-END)
    means = np.array([place[0] for place in path])[kept]
    return StudentTMixture(weights[kept] / weights[kept].sum(), means, np.array(scales)[kept], FREEDOM)


Place = tuple[FloatArray, FloatArray, float, FloatArray, float]
"""Point, direction of the path, negative log posterior, Hessian, step."""


def _side(terms: Terms, start: Place, sign: float) -> list[Place]:
    """Places to one side, up to where the valley rises or meets the end of a range."""
    point, direction, lowest, _, step = start
    direction, found = sign * direction, list[Place]()
    while len(found) < MOST and step > SHORTEST:
        ahead = point + step * direction
        if np.any((ahead < 0) | (ahead > 1)):
            step /= 2  # to the very end of the range
            continue
        there, value, hessian = _bottom(terms, ahead, direction)
        if not value < lowest + END:  # nan is a hill
            break
        _, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        new = vectors[:, 0] * np.sign(vectors[:, 0] @ direction)
        turn = new - (new @ direction) * direction
        sag = step * max(float(turn @ hessian @ turn), 0.0) ** 0.5 / 8
        if sag > SAG or new @ direction < STRAIGHT:
            step /= 2
            continue
        point, direction = there, new
        found.append((point, direction, value, hessian, step))
        if sag < SAG / 8:
            step = min(2 * step, LONGEST)
    return found


def _bottom(terms: Terms, point: FloatArray, direction: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Lowest point of the plane across a direction, its value and Hessian: damped Newton steps."""
    across = _across(direction)
    (value,), (gradient,), (hessian,) = terms(point[None])
    damping = 1e-6
    for _ in range(CORRECTIONS):
        if not np.isfinite(value):
            break
        within = across.T @ hessian @ across
        within = within + damping * np.diag(np.diag(within)) + np.eye(len(within))
        trial = point - across @ np.linalg.solve(within, across.T @ gradient)
        new = terms(np.clip(trial, 0.0, 1.0)[None])
        if new[0][0] < value:
            fall, point = value - new[0][0], np.clip(trial, 0.0, 1.0)
            (value,), (gradient,), (hessian,) = new
            damping = damping / 10
            if fall < SETTLED:
                break
        else:
            damping = max(100 * damping, 1e-3)
    return point, float(value), hessian


def _across(direction: FloatArray) -> FloatArray:
    """Orthonormal basis (d, d - 1) of what is across a direction (d,)."""
    return np.asarray(np.linalg.svd(direction[None])[2][1:].T)


def _component(direction: FloatArray, value: float, hessian: FloatArray, step: float) -> tuple[float, FloatArray]:
    """Log weight and scale matrix of a place."""
    across = _across(direction)
    within = across.T @ hessian @ across + np.eye(len(direction) - 1) / UNDETERMINED**2
    scale = step**2 * np.outer(direction, direction) + across @ np.linalg.inv(within) @ across.T
    return float(np.log(step)) - value - 0.5 * float(np.linalg.slogdet(within)[1]), (scale + scale.T) / 2
