"""The contact patch: a brush whose pressure profile is such that its characteristic is the paper's steady-state curve.

A bristle that has travelled x through a patch of length L under the slip s is bent by x s, until it slides at the limit
mu p(x) / c: its force is c x min(|s|, s_x) with s_x = mu p(x) / (c x). Together

    F(s) = sum_x c x dx min(|s|, s_x),    F'(s) = c x^2 / 2 at the x that begins to slide at s,

so that every concave characteristic belongs to one pressure profile, x(s) = L sqrt(F'(s) / F'(0)). Bristles are chosen
here with evenly spaced s_x up to s_M; the sum over them is then a look-up in its own running sums.

The curve itself (initial slope, maximum at s_M, rational between) is Rill's formula and is shared with the model under
test; so is his linearisation, a force of F(s)/s times (s - rate/v*): a sliding bristle gives way as s_x / |s|.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: so many that even the acceleration, a second derivative, does not see them one by one
BRISTLES = 20_000


def characteristic(s: Array, slope: Array, s_max: Array, f_max: Array) -> Array:
    """Rill's curve [N] for slips 0 <= s <= s_max."""
    sigma = s / s_max
    return slope * s / (1 + sigma * (sigma + slope * s_max / f_max - 2))


def bristles(slope: float, s_max: float, f_max: float) -> tuple[Array, Array]:
    """Slip at which each bristle slides [1] and its stiffness c x dx [N], both (BRISTLES,).

    Raises
    ------
    ValueError
        Where the curve is not concave: no pressure profile makes a brush of it.
    """
    limits = np.linspace(0, s_max, BRISTLES + 1)
    force = characteristic(limits, np.float64(slope), np.float64(s_max), np.float64(f_max))
    stiffness = -np.diff(np.append(np.diff(force) / np.diff(limits), 0.0))
    if np.any(stiffness < 0):
        raise ValueError("the curve is not concave: slope * s_max must be at least 2 f_max")
    return limits[1:], stiffness


def pressure_profile(slope: float, s_max: float, f_max: float) -> tuple[Array, Array]:
    """Place of each bristle x / L and its friction limit mu p(x) / (c L) there, both (BRISTLES,)."""
    limits, stiffness = bristles(slope, s_max, f_max)
    # each stands in the middle of its share of c x dx
    beyond = np.cumsum(stiffness[::-1])[::-1] - 0.5 * stiffness
    place = np.sqrt(beyond / stiffness.sum())
    return place, place * limits


def secant(slip: Array, slope: Array, s_max: Array, f_max: Array) -> Array:
    """F(s)/s [N] of the brush, (n, lanes), for slips (n, lanes) and one brush per lane, (lanes,)."""
    size = np.abs(slip)
    result = np.empty_like(slip)
    for lane in range(slip.shape[1]):
        sliding, sticking = _sums(float(slope[lane]), float(s_max[lane]), float(f_max[lane]))
        first = np.minimum((size[:, lane] * (BRISTLES / s_max[lane])).astype(np.int64), BRISTLES)
        result[:, lane] = sliding[first] / np.maximum(size[:, lane], 1e-12) + sticking[first]
    return result


@lru_cache(maxsize=64)
def _sums(slope: float, s_max: float, f_max: float) -> tuple[Array, Array]:
    """Force [N] of those that slide, stiffness [N] of those that stick, once so many slide, (BRISTLES + 1,)."""
    limits, stiffness = bristles(slope, s_max, f_max)
    sliding = np.concatenate([[0.0], np.cumsum(stiffness * limits)])
    return sliding, np.append(np.cumsum(stiffness[::-1])[::-1], 0.0)
