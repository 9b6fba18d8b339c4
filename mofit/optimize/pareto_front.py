"""The Pareto front: non-dominated points, the hypervolume that they cover, points that fill it."""

from __future__ import annotations

import moocore
import numpy as np
from scipy.spatial import cKDTree

from mofit._typing import FloatArray
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.global_search import Indices
from mofit.optimize.minima_archive import MinimaArchive

#: Objectives up to which the hypervolume is computed exactly, of any front and of one with few points: the effort grows
#: exponentially with the objectives. Up to here it takes 0.1 s; forty points in 12 take 4 s.
_EXACT_OBJECTIVES, _EXACT_OF_FEW, _FEW_POINTS = 4, 10, 40
#: Objectives up to which it is approximated: moocore takes no more, and of so many no direction sees a front.
_MOST_OBJECTIVES = 31
#: Quasi-random directions of the approximation; its error is about 0.002 then, for ten objectives.
_DIRECTIONS = 2**14
#: Points evaluated in one call; the front is formed anew after each.
_BATCH = 32
#: Points of the front that a new one is drawn between.
_PARENTS = 3
#: Standard deviation, in box widths, of a coordinate in which all points of the front are the same.
_SAME = 1e-9


def nondominated(objectives: FloatArray) -> Indices:
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


def hypervolume(objectives: FloatArray, ideal: FloatArray, reference: FloatArray) -> float:
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
        Exact for few objectives or points; else by quasi-random directions [1]_, with an error of about 0.002 for ten
        objectives and 0.03 for thirty. NaN beyond 31 objectives.

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
    count = front.shape[1]
    if count > _MOST_OBJECTIVES:
        return float("nan")
    corner = np.ones(count)
    if count <= _EXACT_OBJECTIVES or (count <= _EXACT_OF_FEW and len(front) <= _FEW_POINTS):
        return float(moocore.hypervolume(front, ref=corner))
    return float(moocore.hv_approx(front, ref=corner, nsamples=_DIRECTIONS, seed=1))


def hypervolume_history(objectives: FloatArray, evaluations: FloatArray) -> FloatArray:
    """Hypervolume of the first n points, for every n of ``evaluations``.

    The box reaches from the best value of every objective among all points to its median among all.
    """
    usable = objectives[np.all(np.isfinite(objectives), axis=1)]
    if len(usable) == 0:
        return np.zeros(len(evaluations))
    ideal, reference = usable.min(axis=0), np.median(usable, axis=0)
    return np.array([hypervolume(objectives[:n], ideal, reference) for n in evaluations])


def fill_front(log: EvaluationLog, archive: MinimaArchive, rng: np.random.Generator, candidates: int = 1) -> None:
    r"""Spend the rest of the budget on points between non-dominated ones.

    .. math:: u = \sum_{i=1}^{3} w_i u_i, \qquad w \sim \mathrm{Dirichlet}(1, 1, 1),

    with :math:`u_i` from the front and nearest to the same minimum of the weighted mean, so that no point lies between
    two modes. Where the objectives are convex near their minima, the Pareto set lies between these. On the paper's rig
    such points fill the front better than predictions from the minima's curvatures, which are poor along
    unidentifiable directions.

    Parameters
    ----------
    log
        Evaluates and counts.
    archive
        Minima of the weighted mean.
    rng
        Draws the parents and their weights.
    candidates
        Points drawn per one evaluated: of all drawn, those farthest from the front and from one another are taken,
        in standard deviations of its coordinates.
    """
    while log.left > 0:
        points = log.points
        front = nondominated(log.values)
        if len(front) < 2:
            return
        mode = archive.nearest(points[front])
        count = min(_BATCH, log.left)
        first = rng.integers(len(front), size=candidates * count)
        parents = np.stack([front[rng.choice(np.flatnonzero(mode == mode[k]), _PARENTS)] for k in first])
        weights = rng.dirichlet(np.ones(_PARENTS), len(first))
        drawn = np.einsum("nk,nkd->nd", weights, points[parents])
        log.evaluate(drawn[_farthest(drawn, points[front], count)])


def _farthest(drawn: FloatArray, known: FloatArray, count: int) -> Indices:
    """Which of the points drawn are farthest from the known ones and from those chosen before, in ascending order."""
    scale = np.maximum(known.std(axis=0), _SAME)  # a coordinate in which all are equal counts nothing
    distance = cKDTree(known / scale).query(drawn / scale)[0]
    chosen = np.empty(count, dtype=np.int64)
    for place in range(count):
        chosen[place] = np.argmax(distance)
        distance = np.minimum(distance, np.linalg.norm((drawn - drawn[chosen[place]]) / scale, axis=1))
        distance[chosen[place]] = -1.0
    return np.sort(chosen)
