"""How many evaluations a search may take: as many as asked for, fewer where the time does not allow them."""

from __future__ import annotations

import time

import numpy as np

from mofit.identification.settings import Settings
from mofit.problem import Problem

#: Share of a time limit for one search, the points at which its pace is measured, and the least and the usual budget.
SEARCH_SHARE, PACED, FEWEST_EVALUATIONS, MOST_EVALUATIONS = 0.25, 4, 100, 4000
#: Share of a user's simulations for one search, and the fewest sets of parameters worth it.
COSTLY_SHARE, FEWEST_SETS = 0.35, 20
#: Budget where every evaluation fits the scoped parameters of all tests.
SCOPED_EVALUATIONS = 1000


def search_budget(problem: Problem, settings: Settings) -> int | None:
    """The budget of a search in evaluations; None: the search's own."""
    if problem.evaluations is not None and np.isfinite(problem.evaluations.left):
        sets = int(COSTLY_SHARE * problem.evaluations.left / len(problem.tests))
        return min(max(sets, FEWEST_SETS), settings.evaluations or sets)
    if settings.time_limit is None:
        return settings.evaluations or (SCOPED_EVALUATIONS if problem.simulator.absorbed else None)
    points = np.random.default_rng(settings.seed).random((PACED + 1, 1, len(problem.space)))
    problem.gradients(points[0])  # compiles
    began = time.perf_counter()
    for point in points[1:]:  # one by one, as most of the search does
        problem.gradients(point)
    pace = (time.perf_counter() - began) / PACED
    allowed = max(FEWEST_EVALUATIONS, int(SEARCH_SHARE * settings.time_limit / pace))
    return min(allowed, settings.evaluations or MOST_EVALUATIONS)
