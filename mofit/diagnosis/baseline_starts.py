"""Where the descents of the baseline start: a sample of the box, of which the best points are taken.

Gauss-Newton descents from there end where a search ends, which takes many more rounds of a quasi-Newton method.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

from mofit._typing import FloatArray
from mofit.identification.problem_setup import ProblemSetup
from mofit.identification.search_weights import search_weights
from mofit.problem import explained

#: Points of a Sobol sequence, a power of two, and how many of the best are taken.
_POINTS, _BEST = 256, 12


def best_points(setup: ProblemSetup) -> FloatArray:
    """Values (k, d) of the problem's parameters that fit best of a sample of what is searched, the best first."""
    searched = setup.searched
    points = qmc.Sobol(len(searched.space), rng=setup.settings.seed).random(_POINTS)
    with explained(searched):
        cost = searched.objectives(points) @ search_weights(searched, setup.settings.weights)
    order = np.argsort(np.nan_to_num(cost, nan=np.inf, posinf=np.inf), kind="stable")
    return searched.layout.values(points[order[:_BEST]], setup.posterior.main.space.names)
