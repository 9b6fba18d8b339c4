"""Which of the points that a search reports are minima, counted alike for every peer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mofit.refine import RefineSettings, merge, refine
from mofit.settings import Settings

Array = NDArray[np.float64]

#: A point so far (nats) above the best minimum is none: mofit leaves modes of less weight out as well.
FOUND = float(-np.log(Settings.least_weight))


class Known(Protocol):
    """A log posterior with derivatives."""

    def log_posterior(self, u: Array) -> Array:
        """Shape (N,)."""
        ...

    @property
    def evaluate(self) -> Callable[[Array], tuple[Array, Array, Array]]:
        """Negative log posterior (N,), its gradient (N, d) and Hessian (N, d, d)."""
        ...


def distinct_minima(ends: Array, known: Known, best: float) -> Array:
    """Of the ends (n, d), those about as good as the best minimum, and of those between which no hill lies the best.

    The rule is `mofit.refine.merge`, applied to the ends as they are.
    """

    def cost(u: Array) -> Array:
        return -known.log_posterior(u)

    good = ends[cost(ends) <= best + FOUND]
    if not len(good):
        return good
    as_they_are = refine(known.evaluate, good, RefineSettings(max_iterations=0))
    return np.array([minimum.point for minimum in merge(as_they_are, values=cost)])
