"""Whether the end of a descent is a new minimum or one that is known."""

from __future__ import annotations

import numpy as np

from mofit.search.ledger import Ledger
from mofit.search.minima import End, Minima
from mofit.search.polish import Descent

#: A rise that a hill must have at least, as a share of the cost's interquartile range over the box.
_ROUNDING = 1e-7
#: Where the line between two ends is tried: the middle decides most cases at the cost of one evaluation.
_PLACES = (np.array([0.5]), np.array([0.2, 0.35, 0.65, 0.8]))


def archive(ledger: Ledger, descent: Descent, spread: float, merge: float) -> None:
    """Add the end of a descent to the minima of its scalarisation, unless it is one of them.

    It is, if it lies within ``merge`` of the nearest, or if a hill-valley test (Ursem 1999; it costs evaluations) finds
    no hill between them.

    Parameters
    ----------
    ledger
        Evaluates the test.
    descent
        What became of a start.
    spread
        Interquartile range of the cost over the box: the scale on which a hill is judged.
    merge
        Ends this close are one minimum.
    """
    minima, end = descent.minima, descent.end
    if end is None:
        return
    minima.inverses.append(end.inverse)
    if minima.ends:
        nearest = int(np.argmin(minima.gaps(end.point)))
        known = minima.ends[nearest]
        same = bool(np.linalg.norm(known.point - end.point) < merge)
        same = same or not _hill_between(ledger, minima, known, end, spread)
        if same:
            if end.cost < known.cost:
                minima.replace(nearest, end)
            return
    minima.add(end)


def _hill_between(ledger: Ledger, minima: Minima, known: End, end: End, spread: float) -> bool:
    """Whether a point between two ends is higher than both; if the budget does not allow to look, yes."""
    top = max(known.cost, end.cost) + _ROUNDING * spread
    for places in _PLACES:
        if ledger.left < len(places):
            return True
        _, values = ledger.evaluate(known.point + places[:, None] * (end.point - known.point))
        if np.any(minima.cost(values) > top):
            return True
    return False
