"""A model fitted without some of its tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.few_periods import at_steps_for
from mofit.diagnosis.fitting import Fitted, of_few_periods
from mofit.diagnosis.hypothesis import Hypothesis, Linear
from mofit.diagnosis.nuisances import with_own_nuisances
from mofit.optimize import RefineSettings, minimise_each

#: Four Gauss–Newton steps from the minimum of all tests to that of all but one, which is near; the damping keeps flat
#: directions solvable.
REFIT = RefineSettings(
    max_iterations=4, gradient_tolerance=0.0, decrease_tolerance=0.0, damping=1e-6, least_damping=1e-6
)
#: Without a whole group the minimum may be farther away.
REFIT_OF_GROUPS = RefineSettings(
    max_iterations=20, gradient_tolerance=0.02, decrease_tolerance=1e-3, damping=1e-6, least_damping=1e-6
)


def leave_out(
    fitted: Fitted, tests: Sequence[Sequence[int]], settings: RefineSettings = REFIT
) -> tuple[Hypothesis, FloatArray]:
    """The hypothesis and its minima without some tests each, (hold-outs, d); by few periods where these do."""
    brief = of_few_periods(fitted)
    few, observed = brief.hypothesis, brief.hypothesis.observed
    kept = np.ones((len(tests), len(brief.residual)), dtype=bool)
    kept[:, : len(observed.measured)] = [~np.isin(observed.test, some) for some in tests]

    def without(points: FloatArray, number: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        first = np.all(points == brief.minimum.point)  # where all start, what is known need not be simulated
        found = Linear(brief.residual[None], brief.jacobian[None]) if first else few.linear(points)
        used = kept[number]
        return Linear(np.where(used, found.residual, 0.0), found.jacobian * used[..., None]).normal_equations()

    starts = np.repeat(brief.minimum.point[None], len(tests), axis=0)
    points = minimise_each(without, starts, settings).points
    points, model = with_own_nuisances(few, points, tests, settings), fitted.hypothesis
    # what is too stiff for the test that was left out shows there alone
    return at_steps_for(model, points, model.steps), points
