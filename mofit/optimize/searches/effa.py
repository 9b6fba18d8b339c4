"""Enhanced firefly algorithm on all tests jointly, then a completion by single linkage."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mofit.optimize.global_search import STAGES, Gradients, Objectives, Progress, SearchResult
from mofit.optimize.mlsl_settings import MlslSettings
from mofit.optimize.rough_landscape import RoughSettings, is_rough, search_rough
from mofit.optimize.single_linkage import SingleLinkage, interquartile_range
from mofit.optimize.swarm import SwarmSettings, cluster_centres, fly


@dataclass(frozen=True)
class EffaSettings:
    """Settings of `search`."""

    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    completion: MlslSettings = field(
        default_factory=lambda: MlslSettings(
            evaluations=4000,
            start_share=1.0,
            test_starts=True,
            single_share=0.1,
            front_share=0.35,
            single_most=150,
            front_most=500,
            front_candidates=4,
        )
    )
    """The budget is that of the whole search: enough until, of four minima, no other is expected. Every point counts as
    one whose basin is known, since a start that lies in a known basin costs few evaluations. The swarm brings points
    near the minima of single objectives, so that these need less."""
    rough: RoughSettings = field(default_factory=RoughSettings)
    """Where descents end although the gradient does not vanish."""


def with_budget(evaluations: int) -> EffaSettings:
    """The settings with another budget for the whole search."""
    default = EffaSettings()
    return replace(default, completion=replace(default.completion, evaluations=evaluations))


def search(
    objectives: Objectives,
    gradients: Gradients,
    dimension: int,
    rng: np.random.Generator,
    settings: EffaSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Enhanced firefly algorithm (eFFA), multi-objective, with a completion; see `mofit.optimize.searches.mlsl.search`.

    1. *Swarm*: the fireflies start at the better points of a Sobol sample and fly for some generations
       (`mofit.optimize.swarm.fly`).
    2. *Clusters*: all points that the swarm evaluated are clustered by their weighted mean, and a gradient descent
       starts from the centre of each cluster. A known minimum ends it early.
    3. *Completion*: multi-level single linkage outside of the basins that are known, until few minima are expected
       undiscovered or the budget is spent (`SearchResult.complete`). If most descents end where the gradient does
       not vanish, at kinks or in structure finer than their steps, and if the budget is large, CMA-ES takes the place
       of the completion and finds the deepest minima alone (`mofit.optimize.rough_landscape`).
    4. *Front*: with several objectives, each is minimised alone, from the minima of the mean and from the points of
       the swarm; the rest of the budget fills the Pareto front.

    Returns
    -------
    SearchResult
        `archived` holds the minima: those of the weighted mean, best first, then those of each objective; `found_by`
        says which stage found them.

    Raises
    ------
    InputError
        If the weights do not fit, or if every firefly failed at the start.

    References
    ----------
    Hackl, Hirschberg, Lex, Magele: Parametrisation of a Maxwell model for transient tyre forces by means of an
    extended firefly algorithm (2016).
    """
    settings = settings or EffaSettings()
    found = SingleLinkage(objectives, gradients, dimension, rng, settings.completion, weights, progress)
    found.draw(settings.completion.round)  # tells how many objectives there are, and so what is reserved
    fireflies = settings.swarm.fireflies(found.log.used + found.log.left)
    found.draw(settings.swarm.candidates * fireflies - len(found.sample))
    swarm = fly(found.log, found.sample, found.mean.weights, rng, settings.swarm)
    flown = swarm.rows
    cost = found.mean.cost(found.log.values[flown])
    centres, labels = cluster_centres(found.log.points[flown], cost, settings.swarm)
    found.descend_from(found.mean, flown[centres], interquartile_range(cost), STAGES[0])
    found.note()
    rough = is_rough(found.log, found.mean, settings.rough)
    if rough:
        without_final = replace(settings.completion, final_tolerance=None)
        found.log.reserved = without_final.reserved(len(found.mean.weights))
        found.mean = search_rough(found.log, found.mean, rng, settings.rough, STAGES[2])
        found.note()
    else:
        found.complete(STAGES[1])
    found.finish(flown, STAGES[:2], tighten=not rough)
    clusters = labels[np.searchsorted(flown, swarm.generations)]
    return found.result(swarm.generations[-1], clusters[-1], generations=swarm.generations, generation_labels=clusters)
