"""Multi-level single linkage: Sobol points, early descents with exact gradients, no basin twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mofit.optimize.global_search import Gradients, Objectives, Progress, SearchResult
from mofit.optimize.mlsl_settings import MlslSettings
from mofit.optimize.single_linkage import SingleLinkage


def with_budget(evaluations: int) -> MlslSettings:
    """The settings with another budget."""
    return MlslSettings(evaluations=evaluations)


def search(
    objectives: Objectives,
    gradients: Gradients,
    dimension: int,
    rng: np.random.Generator,
    settings: MlslSettings | None = None,
    weights: ArrayLike | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    r"""Multi-level single linkage (MLSL) on a Sobol sequence, with a tabu radius around known minima.

    Round by round, the sequence is extended. From each of the better share of its k points, a descent (`descend`)
    starts if no better point lies within

    .. math:: r_k = \pi^{-1/2} \left(\Gamma(1 + d/2)\, \frac{2 \ln k}{k}\right)^{1/d},

    if it has not started before, and if no known minimum lies within the tabu radius. The end is a new minimum unless
    it is close to a known one or a hill-valley test finds no hill between the two.

    This minimises the weighted mean of the objectives until few minima are expected undiscovered. With several
    objectives, each is then minimised singly, from the minima of the mean and from the same points. The rest of the
    budget fills the Pareto front (`fill_front`).

    Parameters
    ----------
    objectives, gradients
        Map points (N, d) of the unit cube to objective vectors (N, T), and to those and their gradients (N, T, d).
    dimension
        Number of coordinates d.
    rng
        The only source of randomness.
    settings
        Constants.
    weights
        Weights of the objectives, shape (T,), none negative; equal if not given.
    progress
        Called as ``progress(evaluations, budget, note)``.

    Returns
    -------
    SearchResult
        `archived` holds the minima: those of the weighted mean, best first, then those of each objective.

    Raises
    ------
    InputError
        If the weights do not fit, or if every point of the first round failed.

    Notes
    -----
    All new points come from the Sobol sequence. Firefly moves of the best points in place of a quarter or half of them
    found fewer minima: on Rastrigin's function, rotated, 99.3 and 98.1 % instead of 99.8 % in three dimensions (2,000
    evaluations), 63 and 56 % instead of 70 % in four (3,000).

    References
    ----------
    Rinnooy Kan and Timmer, "Stochastic global optimization methods, part II: multi level methods", Mathematical
    Programming 39 (1987). Kucherenko and Sytsko, "Application of deterministic low-discrepancy sequences in global
    optimization", Computational Optimization and Applications 30 (2005).
    """
    found = SingleLinkage(objectives, gradients, dimension, rng, settings or MlslSettings(), weights, progress)
    found.complete()
    found.finish(np.empty(0, dtype=np.int64))
    population = found.best_of_sample()
    return found.result(population, found.mean.nearest(found.log.points[population]))
