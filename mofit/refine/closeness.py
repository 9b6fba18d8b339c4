"""When two points are so close that they are, or will end in, the same minimum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array


@dataclass(frozen=True)
class Closeness:
    """Limits on the gap between two points; all of them must hold."""

    deviations: float = 0.5
    """Posterior standard deviations, by the better point's Hessian."""
    width: float = 0.05
    """Box widths, per coordinate: guards directions whose standard deviation is wide."""
    value: float = 0.5
    """Difference of the negative log posterior, in nats."""


def close_pairs(points: Array, values: Array, hessians: Array, closeness: Closeness) -> NDArray[np.bool_]:
    r"""Which point is close to which better one.

    .. math:: \sqrt{\Delta^T H_i \Delta}, \quad \max_k |\Delta_k|, \quad f_j - f_i, \qquad \Delta = u_j - u_i

    are all within the limits. Of equal values, the first counts as the better.

    Parameters
    ----------
    points, values, hessians
        u (K, d), f (K,) and H (K, d, d).

    Returns
    -------
    Shape (K, K), true in [i, j] if j is close to the better point i; nan values are close to none.
    """
    gap = points[None, :, :] - points[:, None, :]
    squared = np.einsum("ijk,ikl,ijl->ij", gap, hessians, gap)
    rise = values[None, :] - values[:, None]
    better = (rise > 0) | ((rise == 0) & np.triu(np.ones_like(rise, dtype=bool), 1))
    near = (squared <= closeness.deviations**2) & (np.abs(gap).max(axis=2) <= closeness.width)
    return near & better & (rise <= closeness.value)
