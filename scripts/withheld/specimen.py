"""The tyre: parameters drawn around the paper's Table 5, and the noise of its force transducer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

#: Table 5; the steady-state curve, which the paper does not print, is typical of size and load
CENTRE = {
    "dF0": 62e3, "s_M": 0.13, "F_M": 3100.0,
    "c_y": 121819.0, "p_y": -7.547, "d_y": 281.0, "c_M": 19910.0, "d_M": 7535.0,
}  # fmt: skip
#: relative standard deviation from specimen to specimen
SPREAD = {"dF0": 0.08, "s_M": 0.06, "F_M": 0.05, "c_y": 0.08, "p_y": 0.1, "d_y": 0.15, "c_M": 0.15, "d_M": 0.15}

#: every kind has about 20 N on the paper's sines
NOISES = ("white", "coloured", "level")
NOISE_SD, COLOUR = 20.0, 0.8
LEAST, PER_FORCE = 6.0, 0.011


def draw_specimen(rng: np.random.Generator) -> dict[str, float]:
    """Values by name."""
    while True:
        normal = np.clip(rng.standard_normal(len(CENTRE)), -2, 2)
        drawn = {
            name: float(value * (1 + SPREAD[name] * z)) for (name, value), z in zip(CENTRE.items(), normal, strict=True)
        }
        # concave enough to be a brush's even with errors of slope and maximum
        if drawn["dF0"] * drawn["s_M"] > 2.4 * drawn["F_M"]:
            return drawn


def add_noise(force: Array, kind: str, rng: np.random.Generator) -> Array:
    """The force (n,) as it is recorded, N."""
    white = rng.standard_normal(len(force))
    if kind == "coloured":
        white[1:] *= np.sqrt(1 - COLOUR**2)
        return force + NOISE_SD * lfilter([1.0], [1.0, -COLOUR], white)
    return force + white * (LEAST + PER_FORCE * np.abs(force) if kind == "level" else NOISE_SD)


def whitened(rows: Array, kind: str, force: Array) -> Array:
    """Signals (n, k) in units of the noise's standard deviation, the noise made white; ``force`` (n,) is noise-free."""
    if kind == "coloured":
        rest = (rows[1:] - COLOUR * rows[:-1]) / (NOISE_SD * np.sqrt(1 - COLOUR**2))
        return np.concatenate([rows[:1] / NOISE_SD, rest])
    return rows / (LEAST + PER_FORCE * np.abs(force[:, None]) if kind == "level" else NOISE_SD)
