"""How an input runs between its samples: one curve for equations, functions and FMUs."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from mofit._typing import FloatArray
from mofit.quantities import HOLD


def input_curve(step: float, inputs: FloatArray, interpolation: str) -> PPoly:
    """Inputs (n, nu) every ``step`` s, from 0 on, as polynomials between samples.

    ``"cubic"``: not-a-knot cubic spline; ``"linear"``: straight lines; ``"hold"``: the value of the last sample.
    """
    time = np.arange(len(inputs)) * step
    inputs = np.asarray(inputs, dtype=float)
    if len(inputs) == 1:
        return PPoly(inputs[None], np.array([0.0, step]))
    if interpolation == HOLD:
        return PPoly(inputs[None], np.append(time, len(inputs) * step))
    if interpolation == "linear":
        return PPoly(np.stack([np.diff(inputs, axis=0) / step, inputs[:-1]]), time)
    # one input after the other: making a spline takes several times its memory
    return PPoly(np.stack([CubicSpline(time, column).c for column in inputs.T], axis=-1), time)
