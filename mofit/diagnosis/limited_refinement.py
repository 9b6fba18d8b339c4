"""Local refinement that ends early where the minimum cannot count."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.optimize import Minimum, RefineSettings, merge, refine
from mofit.optimize.levenberg_marquardt import Evaluate

#: Iterations before one of several starts may be given up, which may lie far from any minimum; and those over which the
#: pace is measured: rejected steps come in rows.
_FIRST, _PACE = 2, 8
#: Share of what a start lacks of the limit that a Newton step must promise, and the last iterations must have gained:
#: with less, hardly anything will change.
HOPELESS = 0.05
#: Share of what a start lacks of the best one that a Newton step must promise: in a bent valley it promises too little.
#: All of it where the best one is given up: which of two without hope is the better does not count.
_BEHIND, _BEHIND_HOPELESS = 0.5, 1.0
#: Nats that a start must gain over as many iterations, or share of what a Newton step promises: in a curved valley it
#: converges slowly, and where values and derivatives disagree never.
_LEAST, _KEPT = 1e-2, 5e-2


def best_minimum(
    evaluate: Evaluate,
    starts: ArrayLike,
    settings: RefineSettings,
    limit: float = np.inf,
    least: float = 0.0,
    known: float = np.inf,
) -> Minimum:
    """The best minimum from starts (K, d) of the unit cube.

    ``limit`` is the value that counts: a start far above it ends where hardly anything changes, and one behind another
    where it cannot catch up with that one. A start alone is taken to be near its minimum. With a limit ``least`` is the
    share of its value that a start must gain over some iterations. What ends above a ``known`` value is of no use.

    Raises
    ------
    InputError
        If no start can be evaluated.
    """
    return min(minima(evaluate, starts, settings, limit, least, known), key=lambda one: one.value)


def minima(
    evaluate: Evaluate,
    starts: ArrayLike,
    settings: RefineSettings,
    limit: float = np.inf,
    least: float = 0.0,
    known: float = np.inf,
) -> Sequence[Minimum]:
    """All minima of `best_minimum`."""
    first = 0 if len(np.atleast_2d(starts)) == 1 else _FIRST
    hopes = _Hopes(limit, known, first, least) if np.isfinite(limit) else None
    return merge(refine(evaluate, starts, settings, go_on=hopes))


class _Hopes:
    """Which starts may still come down to a limit, asked once per iteration."""

    def __init__(self, limit: float, known: float, first: int, least: float) -> None:
        self.limit, self.known, self.first, self.least, self.iterations = limit, known, first, least, 0
        self.before: deque[FloatArray] = deque(maxlen=_PACE)

    def __call__(self, values: FloatArray, promised: FloatArray) -> NDArray[np.bool_]:
        on = np.ones(len(values), dtype=bool)
        if self.iterations >= self.first:
            best = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
            on &= promised > HOPELESS * (values - self.limit)
            on &= promised >= (_BEHIND if on[best] else _BEHIND_HOPELESS) * (values - values[best])
            on &= promised >= _BEHIND * (values - self.known)
        if len(self.before) == _PACE:
            least = np.maximum(np.maximum(self.least * np.abs(values), _KEPT * promised), _LEAST)
            on &= self.before[0] - values > np.maximum(HOPELESS * (values - self.limit), least)
        self.before.append(values)
        self.iterations += 1
        return on
