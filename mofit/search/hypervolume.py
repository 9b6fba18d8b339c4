"""How much of the objective space a set of points covers."""

from __future__ import annotations

import moocore
import numpy as np

from mofit.parameters import Array
from mofit.search.front import nondominated

#: Exact computation grows exponentially with the objectives: up to here it takes milliseconds.
_EXACT_OBJECTIVES, _EXACT_POINTS = 4, 40
#: Quasi-random directions of the approximation; its error is about 0.002 then.
_DIRECTIONS = 2**14


def hypervolume(objectives: Array, ideal: Array, reference: Array) -> float:
    r"""Share of the box between `ideal` and `reference` that some point dominates.

    .. math:: \frac{\lambda\bigl(\bigcup_i [f_i, r]\bigr)}{\prod_t (r_t - i_t)}, \qquad 0 \dots 1

    Parameters
    ----------
    objectives
        Values to minimise, shape (n, objective); rows with nan or beyond the reference count nothing.
    ideal, reference
        Best and worst corner, shape (objective,); an objective in which they coincide is left out.

    Returns
    -------
    float
        Exact for few objectives or points; else by quasi-random directions [1]_, with an error of about 0.002.

    References
    ----------
    .. [1] Deng and Zhang, "Approximating hypervolume and hypervolume contributions using polar coordinate", IEEE
       Transactions on Evolutionary Computation 23 (2019).
    """
    spread = reference - ideal
    used = spread > 0
    if not used.any():
        return 0.0
    scaled = (objectives[:, used] - ideal[used]) / spread[used]
    scaled = scaled[np.all(scaled < 1, axis=1)]
    if len(scaled) == 0:
        return 0.0
    front = np.maximum(scaled[nondominated(scaled)], 0.0)
    corner = np.ones(front.shape[1])
    if front.shape[1] <= _EXACT_OBJECTIVES or len(front) <= _EXACT_POINTS:
        return float(moocore.hypervolume(front, ref=corner))
    return float(moocore.hv_approx(front, ref=corner, nsamples=_DIRECTIONS, seed=1))


def hypervolume_history(objectives: Array, evaluations: Array) -> Array:
    """Hypervolume of the first n points, for every n of ``evaluations``.

    The box reaches from the best value of every objective among all points to its median among all.
    """
    usable = objectives[np.all(np.isfinite(objectives), axis=1)]
    if len(usable) == 0:
        return np.zeros(len(evaluations))
    ideal, reference = usable.min(axis=0), np.median(usable, axis=0)
    return np.array([hypervolume(objectives[:n], ideal, reference) for n in evaluations])
