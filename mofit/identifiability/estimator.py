r"""How far the estimates of an identification will scatter, predicted from tests that need not have been run.

`mofit.identify` minimises weighted squares, so that its estimates do not reach the bound :math:`(\sum F_t + P)^{-1}`
where tests differ in their noise's colour; they have the covariance

.. math:: \left(H J^{-1} H + P\right)^{-1}, \qquad
          H = \sum_t w_t S_t^T S_t, \quad J = \sum_t w_t^2 S_t^T \Sigma_t S_t

(`mofit.objectives.curvature`), P being what the calibration stages know.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.fisher import Sensitivity
from mofit.objectives import Adjustment, Score, adjust

Array = NDArray[np.float64]

#: Precision in the unit cube of a parameter that is uniform over its box.
BOX_PRECISION = 12.0


def expected_score(tests: Sequence[Sensitivity], point: int, stretch: Array) -> Score:
    """What `mofit.score.score` finds on average over the noise, where the model is right.

    Parameters
    ----------
    tests
        Sensitivities by d parameters.
    point
        Which of their parameter sets.
    stretch
        Derivative of the value by the unit coordinate, (d,).
    """
    square = np.outer(stretch, stretch)
    scatter = np.stack([test.scatter[point] for test in tests]) * square
    return Score(
        slope=np.zeros((len(tests), len(stretch))),
        normal=np.stack([test.normal[point] for test in tests]) * square,
        noise=scatter,
        gap=np.zeros_like(scatter),
        freedom=np.full(len(tests), min(part.freedom.min() for part in _parts(tests, point))),
        gap_freedom=1.0,
    )


def expected_adjustment(tests: Sequence[Sensitivity], point: int, stretch: Array, centre: Array) -> Adjustment:
    """The adjusted likelihood of these tests around the truth ``centre`` (d,) in the unit cube."""
    return adjust(expected_score(tests, point, stretch), centre, with_gap=False)


def estimator_precision(tests: Sequence[Sensitivity], stretch: Array) -> Array:
    """Precision of the estimate from these tests, (N, d, d) in the unit cube, from ``stretch`` (N, d); without a prior.

    nan where a simulation fails.
    """
    dimension = stretch.shape[1]
    found = np.full((len(stretch), dimension, dimension), np.nan)
    for point, own in enumerate(stretch):
        if all(np.isfinite(test.normal[point]).all() for test in tests):
            found[point] = expected_adjustment(tests, point, own, np.zeros(dimension)).precision
    return found


def bound_precision(tests: Sequence[Sensitivity], stretch: Array) -> Array:
    """Precision of the best estimate that these tests allow, (N, d, d) in the unit cube: the Fisher information."""
    total = np.sum([test.information for test in tests], axis=0)
    return np.asarray(total * stretch[:, :, None] * stretch[:, None, :])


def _parts(tests: Sequence[Sensitivity], point: int):  # type: ignore[no-untyped-def]
    return (part for test in tests for own in test.noise for part in own[point])
