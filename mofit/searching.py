"""The searches by name, on a problem."""

from __future__ import annotations

import numpy as np

from mofit.errors import InputError, did_you_mean
from mofit.posing import search_weights
from mofit.problem import Problem
from mofit.search import PAPER, SearchResult, effa, niching, surrogate
from mofit.search.result import Progress
from mofit.settings import SEARCHES, Settings


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
    weights, rng = search_weights(problem, settings), np.random.default_rng(settings.seed)
    dimension = len(problem.space)
    match settings.search:
        case "niching":
            return niching(problem.objectives, problem.gradients, dimension, rng, None, weights, progress)
        case "paper":
            return effa(problem.objectives, dimension, rng, PAPER, weights, progress)
        case "surrogate":
            return surrogate(problem.objectives, dimension, rng, None, weights, progress)
        case other:
            raise InputError.of("--search", f"unknown search '{other}'", did_you_mean(other, SEARCHES))
