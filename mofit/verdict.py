"""What the data say of a parameter, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A posterior that keeps more than this share within `EDGE` of a bound leans on it.
LEANING = 0.05
EDGE = 0.01
#: Contractions (1 - posterior sd / prior sd) below these are no learning, and little.
UNMOVED = 0.1
WEAK = 0.5


def contraction(samples: Array) -> Array:
    """1 - posterior sd / prior sd per parameter, for samples (n, d) in the unit cube (uniform prior)."""
    return 1.0 - samples.std(axis=0) * np.sqrt(12.0)


def verdict(samples: Array) -> list[str]:
    """One verdict per parameter from posterior samples (n, d) in the unit cube.

    ``identified``; ``weakly identified``; ``lower limit only`` (the posterior leans on the upper bound); ``upper limit
    only`` (on the lower one); ``not identifiable`` (not moved from the prior).
    """
    words = []
    for column, learnt in zip(samples.T, contraction(samples), strict=True):
        low, high = np.mean(column < EDGE) > LEANING, np.mean(column > 1 - EDGE) > LEANING
        if learnt < UNMOVED or (low and high):
            words.append("not identifiable")
        elif high:
            words.append("lower limit only")
        elif low:
            words.append("upper limit only")
        else:
            words.append("identified" if learnt >= WEAK else "weakly identified")
    return words
