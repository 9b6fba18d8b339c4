"""The size of a fitted effect as one number, and its parameters in the tests."""

from __future__ import annotations

import numpy as np

from mofit.diagnosis.fitting import Fitted
from mofit.models import Effect


def size_of(fitted: Fitted, effect: Effect) -> tuple[float, float]:
    """Size of an effect of the fitted model and its standard deviation: of several components, their length.

    A component with a value per test counts by the root mean square over the tests.
    """
    layout = fitted.hypothesis.layout
    values = layout.space.from_unit(fitted.minimum.point)
    away, share = np.zeros((2, len(values)))
    for name in effect.size:
        place = layout.coordinates(name)
        share[place] = len(place) ** -0.5
        away[place] = share[place] * (values[place] - effect.neutral[name])
    single = np.count_nonzero(share) == 1
    size = float(away.sum() if single else np.linalg.norm(away))
    slope = share if single else share * away / max(size, 1e-300)
    return size, fitted.sd_along(slope * fitted.derivative)


def parameters_of(fitted: Fitted, effect: Effect) -> dict[str, float]:
    """Fitted values of an effect's parameters, one per test or condition where they differ."""
    layout, names = fitted.hypothesis.layout, [p.name for p in effect.parameters]
    values = fitted.values
    return {layout.space.names[k]: values[layout.space.names[k]] for name in names for k in layout.coordinates(name)}
