"""Noise of unit standard deviation: white, autoregressive of order 1, and 1/f."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from mofit._typing import FloatArray

#: samples before the record
BEFORE = 4000


def noise(rng: np.random.Generator, kind: str, count: int) -> FloatArray:
    """One record (count,); its expected mean square is 1."""
    white = rng.normal(size=count + BEFORE)
    if kind == "white":
        return white[BEFORE:]
    if kind == "AR(0.8)":
        return np.asarray(lfilter([np.sqrt(1 - 0.8**2)], [1.0, -0.8], white)[BEFORE:])
    steps = np.arange(1, count + BEFORE)  # Kasdin's filter
    weights = np.cumprod(np.concatenate([[1.0], (steps - 0.5) / steps]))
    return np.asarray(np.convolve(white, weights)[BEFORE : count + BEFORE] / np.linalg.norm(weights[:BEFORE]))
