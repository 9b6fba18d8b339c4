"""How much each objective counts in the search."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.problem import Problem


def search_weights(problem: Problem, weights: Mapping[str, float]) -> FloatArray:
    """Weight of every objective in the search, shape (objectives,); 1 where not named.

    Parameters
    ----------
    problem
        Its tests and objectives have the names.
    weights
        By name. A test's holds for all of its outputs, unless one is named itself (``test / output``).

    Raises
    ------
    InputError
        With every name that is neither a test nor an objective.
    """
    names = problem.objective_names
    known = dict.fromkeys((*problem.tests, *names))
    raise_errors(
        Issue("--weights", f"no test '{name}'", did_you_mean(name, known)) for name in weights if name not in known
    )
    return np.array([weights.get(name, weights.get(name.partition(" / ")[0], 1.0)) for name in names])
