"""The share of the gap that the score test alone promises to remove on tests left out, before any refit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.mean_squares import noise_squares, record_signals
from mofit.diagnosis.nuisances import beside_nuisances

#: Standard deviations of the noise's power beyond which the linearised effect leaves a gap.
_CLEAR = 4.0


def predicted_share(baseline: Fitted, added: Sequence[FloatArray], remainder: bool) -> float:
    """The share that the linearised models remove on each test when fitted to the others.

    What they leave counts only if the best model is known to leave a ``remainder``: a strong effect bends its own
    direction, and the linear rest of that does not count.
    """
    observed, rows = baseline.hypothesis.observed, len(baseline.hypothesis.observed.measured)
    model, both, residuals = beside_nuisances(baseline, added)
    told = observed.told(np.column_stack([residuals[:rows], both[:rows]]))
    signals = list(record_signals(observed, told, observed.explainable))
    gap, uncertain, left = 0.0, 0.0, 0.0
    for t in range(len(observed.problem.tests)):
        fitted_to = np.ones(len(model), dtype=bool)
        fitted_to[:rows] = observed.test != t
        residual = residuals[fitted_to]
        (alone, _), (shift, covariance) = (_solved(columns[fitted_to], residual) for columns in (model, both))
        for (test, _, _), here in zip(observed.records, signals, strict=True):
            if test == t:
                columns = here[:, 1:]
                gap += float(np.sum((columns @ shift - columns[:, : len(alone)] @ alone) ** 2))
                uncertain += float(np.sum(covariance * (columns.T @ columns)))
                left += float(np.sum((here[:, 0] - columns @ shift) ** 2))
    # what is left beyond noise and uncertainty, if that is no chance
    noise = noise_squares(observed, observed.explainable)
    left -= float(noise.sum()) + uncertain
    clear = _CLEAR * float(np.sqrt(2 * noise @ noise))
    uncertain += left if remainder and left > clear else 0.0
    return 1 - uncertain / (gap + uncertain) if gap > 0 else 0.0


def _solved(columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares solution and its covariance; scaled, as effects have sizes of their own."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / scale
    inverse = np.linalg.inv(scaled.T @ scaled + 1e-12 * np.eye(len(scale))) / np.outer(scale, scale)
    return inverse @ (columns.T @ residual), inverse
