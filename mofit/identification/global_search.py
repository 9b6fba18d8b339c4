"""Search the parameters of a problem with the search that the settings name."""

from __future__ import annotations

import numpy as np

from mofit.identification.problem_setup import search_weights
from mofit.identification.search_registry import find_search
from mofit.identification.settings import Settings
from mofit.optimize import Progress, SearchResult
from mofit.problem import Problem


def search(problem: Problem, settings: Settings, progress: Progress | None = None) -> SearchResult:
    """Search the box of a problem's free parameters, all tests at once.

    Parameters
    ----------
    problem
        One objective per test.
    settings
        The search's name, its seed, and the weights of the tests.
    progress
        Called as ``progress(done, total, note)``.

    Raises
    ------
    InputError
        If there is no search of that name, or if every start fails.
    """
    run, rng = find_search(settings.search), np.random.default_rng(settings.seed)
    weights = search_weights(problem, settings)
    return run(problem.objectives, problem.gradients, len(problem.space), rng, None, weights, progress)
