"""Enhanced firefly algorithm on all tests jointly, then a completion by single linkage."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mofit.optimize.global_search import Gradients, Objectives, Progress, SearchResult
from mofit.optimize.rough_landscape import RoughSettings, is_rough, search_rough
from mofit.optimize.single_linkage import MlslSettings, SingleLinkage, interquartile_range
from mofit.optimize.swarm import SwarmSettings, cluster_centres, fly

#: Stages of the search that find minima.
SWARM, COMPLETION, ADAPTATION = "swarm", "completion", "adaptation"


@dataclass(frozen=True)
class EffaSettings:
    """Settings of `search`."""

    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    completion: MlslSettings = field(
        default_factory=lambda: MlslSettings(
            evaluations=1200, start_share=1.0, test_starts=True, single_share=0.1, front_share=0.35, front_candidates=4
        )
    )
    """The budget is that of the whole search. One minimum in up to five parameters takes 1,000 evaluations until no
    other is expected. The swarm brings points near the minima of single objectives, so that these need less."""
    rough: RoughSettings = field(default_factory=RoughSettings)


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

    1. *Swarm*: the fireflies start on a Sobol sample and fly for some generations (`mofit.optimize.swarm.fly`).
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
    first = found.draw(settings.swarm.fireflies(settings.completion.evaluations))
    swarm = fly(found.log, first, found.mean.weights, rng, settings.swarm)
    flown = swarm.rows
    cost = found.mean.cost(found.log.values[flown])
    centres, labels = cluster_centres(found.log.points[flown], cost, settings.swarm)
    found.descend_from(found.mean, flown[centres], interquartile_range(cost), SWARM)
    found.note()
    rough = is_rough(found.log, found.mean, settings.rough)
    if rough:
        found.log.reserved = int(
            replace(settings.completion, final_tolerance=None).reserved_share(len(found.mean.weights))
            * found.log.budget
        )
        found.mean = search_rough(found.log, found.mean, rng, settings.rough, ADAPTATION)
        found.note()
    else:
        found.complete(COMPLETION)
    found.finish(flown, (SWARM, COMPLETION), tighten=not rough)
    clusters = labels[np.searchsorted(flown, swarm.generations)]
    return found.result(swarm.generations[-1], clusters[-1], generations=swarm.generations, generation_labels=clusters)
