"""Minima along one valley: a curved path of equal cost joins them, so they are one solution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit.identification.combinations import UNDETERMINED
from mofit.optimize import Minimum, RefineSettings, refine
from mofit.problem import Posterior

#: Points on the line between two minima, from which descents lead down into the valley.
STEPS = 7
#: Nats that the valley may rise above the worse of the two: a density ratio of e is no obstacle.
BARRIER = 1.0
#: Longest gap between neighbours on the path, in distances between the minima: a longer one left the valley.
GAP = 0.5


def without_joined(posterior: Posterior, minima: Sequence[Minimum]) -> list[Minimum]:
    """The minima, best first, without those that a valley joins with a better one.

    Only two that both have a direction which the data do not determine can be joined; a straight valley was found when
    they were refined (`mofit.optimize.merge`).
    """
    kept: list[Minimum] = []
    for minimum in sorted(minima, key=lambda one: one.value):
        if not (_flat(minimum) and any(_flat(other) and _joined(posterior, other, minimum) for other in kept)):
            kept.append(minimum)
    return kept


def _flat(minimum: Minimum) -> bool:
    return bool(np.linalg.eigvalsh(minimum.hessian)[0] < UNDETERMINED**-2)


def _joined(posterior: Posterior, first: Minimum, second: Minimum) -> bool:
    """Whether descents from the line between two minima end low, and near one another, all along."""
    along = np.linspace(0.0, 1.0, STEPS + 2)[1:-1, None]
    ends = refine(
        posterior.evaluate, first.point + along * (second.point - first.point), RefineSettings(merge=None, lanes=4)
    )
    if not np.all(ends.values <= max(first.value, second.value) + BARRIER):  # nan is a hill
        return False
    path = np.concatenate([first.point[None], ends.points, second.point[None]])
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return bool(np.all(steps <= GAP * np.linalg.norm(second.point - first.point)))
