"""Points between those of the Pareto front, to fill it."""

from __future__ import annotations

import numpy as np

from mofit.search.front import nondominated
from mofit.search.ledger import Ledger
from mofit.search.minima import Minima

#: Points evaluated in one call; the front is formed anew after each.
BATCH = 32
#: Points of the front that one compromise is drawn from.
PARENTS = 3


def compromises(ledger: Ledger, main: Minima, rng: np.random.Generator) -> None:
    r"""Spend what is left of the budget on points amid non-dominated ones.

    .. math:: u = \sum_{i=1}^{3} w_i u_i, \qquad w \sim \mathrm{Dirichlet}(1, 1, 1),

    with :math:`u_i` from the front and nearest to the same minimum of the weighted mean, so that no compromise lies
    between two modes. Where the objectives are convex near their minima, the Pareto set is what lies between these; on
    the paper's rig such points fill the front better than predictions from the minima's curvatures, which are poor
    along flat directions.

    Parameters
    ----------
    ledger
        Evaluates.
    main
        Minima of the weighted mean: the modes.
    rng
        Draws the parents and their weights.
    """
    while ledger.left > 0:
        points = ledger.points
        front = nondominated(ledger.values)
        if len(front) < 2:
            return
        mode = main.nearest(points[front])
        first = rng.integers(len(front), size=min(BATCH, ledger.left))
        parents = np.stack([front[rng.choice(np.flatnonzero(mode == mode[k]), PARENTS)] for k in first])
        weights = rng.dirichlet(np.ones(PARENTS), len(first))
        ledger.evaluate(np.einsum("nk,nkd->nd", weights, points[parents]))
