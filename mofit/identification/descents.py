"""Descents with a costly simulator: few starts, and no step that changes less than a chart would show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.optimize import RefineSettings
from mofit.optimize.local_minima import Closeness
from mofit.problem import Problem

#: A simulator's noise hides smaller gains than these: 1e-2 standard deviations. What the descent leaves the sampling
#: finds, since the emulator is trained around the end and not only there.
COSTLY = RefineSettings(max_iterations=25, gradient_tolerance=1e-2, decrease_tolerance=1e-4, most_damping=1e5)
#: Share of the simulations left that descents from all starts may take, and the steps of each.
SHARE, STEPS = 0.3, 8


def settings_for(
    problem: Problem, *, merge: Closeness | None = COSTLY.merge, until: float = math.inf
) -> RefineSettings:
    """Settings of a descent."""
    return replace(RefineSettings() if problem.evaluations is None else COSTLY, merge=merge, until=until)


def few_starts(problem: Problem, starts: FloatArray, found_by: Sequence[str]) -> tuple[FloatArray, list[str]]:
    """As many starts (k, d) as the simulations allow, best first; all of them where these cost nothing."""
    if problem.evaluations is None or np.isinf(problem.evaluations.left):
        return starts, list(found_by)
    per_step = len(problem.tests) * (1 + len(problem.space))
    most = max(1, int(SHARE * problem.evaluations.left / (STEPS * per_step)))
    cost = problem.objectives(starts).sum(axis=1)  # known from the search
    order = np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable")[:most]
    return starts[order], [found_by[k] for k in order]
