"""What each other effect leaves of a hidden one, at the size at which it comes closest."""

from __future__ import annotations

import numpy as np
from causes import LIBRARY, RIVALS
from numpy.typing import NDArray
from respond import Case
from strength import SHARE, Ground, settings_of

Array = NDArray[np.float64]

#: whitened squares left by what is hardly taken for the hidden effect: its size need not be found
FAR = 60.0
#: times the size is found from the direction at the size before
ROUNDS = 2


def closest(place: Ground, gap: Array) -> dict[str, float]:
    """Squares that library and rivals leave of a gap (m,), each at its best shape and size.

    A direction depends on the size at which it is taken: a low-pass of milliseconds is no delay, one of microseconds
    is. Effects of two components are linear in them, and taken as they are.
    """
    found = place.separation(gap)
    whole = place.left(gap)
    near = [one for one in (*LIBRARY, *RIVALS) if len(one.typical) == 1 and found.get(one.name, 0.0) < FAR]
    kinds = [(cause, where, knobs) for cause in near for _, where, knobs in settings_of(cause)]
    signed = np.array([cause.both_signs for cause, _, _ in kinds])
    most = np.array([cause.most for cause, _, _ in kinds])
    factors = np.ones(len(kinds))
    for _ in range(1 + ROUNDS):
        sized = [
            ({name: value * (factor if name in cause.typical else 1.0) for name, value in knobs.items()}, where)
            for factor, (cause, where, knobs) in zip(factors, kinds, strict=True)
        ]
        grown, left = place.fitted(
            gap, place.changes([Case(place.specimen, knobs, dict.fromkeys(knobs, where)) for knobs, where in sized])
        )
        left = np.where(signed | (grown > 0), left, whole)
        usable = (signed | (grown > 0)) & (SHARE * np.abs(grown * factors) < most)
        factors = np.where(usable, grown * factors, factors)
    for name in {cause.name for cause in near}:
        found[name] = float(min(one for one, (cause, _, _) in zip(left, kinds, strict=True) if cause.name == name))
    return found
