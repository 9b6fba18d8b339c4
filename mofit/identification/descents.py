"""Descents from the points of a search; with a costly simulator few of them, and no step too small for a chart."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.optimize import STAGES, RefineSettings, SearchResult, merge, refine
from mofit.optimize.linkage import linked_starts
from mofit.optimize.local_minima import Closeness, Refined
from mofit.optimize.minima_archive import expected_undiscovered
from mofit.problem import AdjustedPosterior, CampaignPosterior, Problem, explained

#: A simulator's noise hides much smaller gains than a thousandth of a nat; one of a hundredth lies 0.14 standard
#: deviations away, and noise and adjustment are those of the end.
COSTLY = RefineSettings(max_iterations=25, gradient_tolerance=0.03, decrease_tolerance=1e-3, most_damping=1e5)
#: Share of the simulations left that descents may take, and the steps that one is expected to take.
SHARE, STEPS = 0.5, 8
#: Slopes by central differences that are kept for the best minimum; to find their steps takes two more.
REFINEMENT = 5
#: Descents that begin together, and the expected number of undiscovered minima at which no others begin.
ROUND, UNDISCOVERED = 4, 0.5


def settings_for(
    problem: Problem, *, merge: Closeness | None = COSTLY.merge, until: float = math.inf
) -> RefineSettings:
    """Settings of a descent."""
    return replace(RefineSettings() if problem.evaluations is None else COSTLY, merge=merge, until=until)


def descend(posterior: CampaignPosterior | AdjustedPosterior, starts: FloatArray, settings: RefineSettings) -> Refined:
    """As `mofit.optimize.refine`; differences are taken only where a step is accepted, which saves most simulations."""
    problem = posterior.problem if isinstance(posterior, AdjustedPosterior) else posterior
    evaluations = problem.main.evaluations
    by_differences = evaluations is not None and not evaluations.offers_slopes
    return refine(posterior.evaluate, starts, settings, posterior.value if by_differences else None)


def kept_for_refinement(problem: Problem) -> int:
    """Simulations that the descent from the best minimum takes at least."""
    return REFINEMENT * len(problem.tests) * (1 + 2 * len(problem.space))


def starts_of(found: SearchResult) -> tuple[FloatArray, list[str]]:
    """The minima that the search archived, its best point of each objective, and the stage that found each."""
    best = [int(row) for row in np.nanargmin(found.objectives, axis=0)]
    stages = dict.fromkeys(best, "")
    if found.found_by:
        stages = {row: STAGES[0] if row in found.generations else STAGES[1] for row in best}
        stages |= dict(zip(found.archived.tolist(), found.found_by, strict=True))
    rows = list(dict.fromkeys([*found.archived.tolist(), *best]))
    return found.points[rows], [stages.get(row, "") for row in rows]


def completed(problem: Problem, found: SearchResult, until: float = math.inf) -> tuple[SearchResult, FloatArray]:
    """A search of a costly simulator, completed by descents of the simulator itself, and the minima (k, d) they reach.

    The minima of a surrogate of the cost may be few: it is too coarse to show a narrow one. So descents begin at its
    minima and at all evaluated points with none better near (single linkage), best first, until few minima are
    expected undiscovered (`expected_undiscovered`) or their share of the simulations is spent. What was kept for the
    refinement is free then.

    Parameters
    ----------
    problem, found
        What was searched, with simulations counted, and the outcome.
    until
        That of `RefineSettings`.
    """
    evaluations = problem.evaluations
    assert evaluations is not None
    evaluations.settle(near_minimum=False)
    rows = list(dict.fromkeys([*found.archived.tolist(), *linked_starts(found.points, found.cost, 1.0)]))
    before, allowed = evaluations.count, SHARE * evaluations.left
    each = STEPS * len(problem.tests) * (1 + len(problem.space))
    minima, tried, undiscovered = found.points[:0], 0, math.inf
    settings = settings_for(problem, until=until)
    while tried < len(rows) and undiscovered > UNDISCOVERED and time.monotonic() < until:
        spent = evaluations.count - before
        affordable = (allowed - spent) / (max(spent, 1) / tried if tried else each)
        if tried and affordable < 1:
            break
        batch = rows[tried : tried + int(np.clip(affordable, 1, ROUND))]
        with explained(problem):
            ends = descend(problem, np.concatenate([minima, found.points[batch]]), settings)
        every = merge(ends, values=lambda u: -problem.log_posterior(u))
        # what is still on its way is no minimum, and to follow it may take all simulations
        reached = [one for one in every if one.converged] or every
        minima, tried = np.stack([minimum.point for minimum in reached]), tried + len(batch)
        undiscovered = expected_undiscovered(tried, len(minima))
    evaluations.settle(near_minimum=True)
    evaluations.reserved.pop("refinement", None)
    complete = undiscovered <= UNDISCOVERED
    if tried == len(rows) and not complete:  # no start is left: how many basins there are these few do not tell
        return found, minima
    return replace(found, expected_undiscovered=undiscovered, complete=complete), minima
