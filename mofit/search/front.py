"""The points that no other point beats in every objective."""

from __future__ import annotations

import moocore
import numpy as np

from mofit.parameters import Array
from mofit.search.result import Indices


def nondominated(objectives: Array) -> Indices:
    r"""Rows whose objective vector is not dominated.

    A vector :math:`a` dominates :math:`b` if :math:`a_t \le b_t` for every objective and :math:`a_t < b_t` for one. Of
    equal vectors only the first is kept. Rows with a nan or an infinite entry (failed simulations) never count.

    Parameters
    ----------
    objectives
        Values to minimise, shape (n, objective).

    Returns
    -------
    Row numbers, ascending.
    """
    usable = np.flatnonzero(np.isfinite(objectives).all(axis=1))
    if usable.size == 0:
        return usable
    return usable[moocore.is_nondominated(np.ascontiguousarray(objectives[usable]))]
