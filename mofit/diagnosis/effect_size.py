"""The size of a fitted effect as one number, and its parameters in the tests."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.models import Effect


def size_of(fitted: Fitted, effect: Effect) -> tuple[float, float]:
    """Size of an effect of the fitted model and its standard deviation: of several components, their length.

    A component with a value per test counts by the root mean square over the tests.
    """
    parts = [_component(fitted, effect, name) for name in effect.size]
    away, sds = np.concatenate([one for one, _ in parts]), np.concatenate([sd for _, sd in parts])
    if len(away) == 1:
        return float(away[0]), float(sds[0])
    size = float(np.linalg.norm(away))
    return size, float(np.linalg.norm(away * sds) / max(size, 1e-300))


def _component(fitted: Fitted, effect: Effect, name: str) -> tuple[FloatArray, FloatArray]:
    """Distances from neutral and their standard deviations, per value; their squares add up to the component's."""
    layout = fitted.hypothesis.layout
    place = layout.coordinates(name)
    values = layout.space.from_unit(fitted.minimum.point)[place]
    share = len(place) ** -0.5
    return share * (values - effect.neutral[name]), share * (fitted.sd() * fitted.derivative)[place]


def parameters_of(fitted: Fitted, effect: Effect) -> dict[str, float]:
    """Fitted values of an effect's parameters, one per test or condition where they differ."""
    layout, names = fitted.hypothesis.layout, [p.name for p in effect.parameters]
    values = fitted.values
    return {layout.space.names[k]: values[layout.space.names[k]] for name in names for k in layout.coordinates(name)}
