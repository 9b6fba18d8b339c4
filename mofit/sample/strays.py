"""Walkers that no longer sample the mode they were started in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array


def outliers(positions: Array, log_prob: Array, threshold: float = 8.0) -> NDArray[np.bool_]:
    """Walkers far from the crowd at one moment.

    In any coordinate, or in log posterior, further from the median than `threshold` robust standard deviations (1.48
    times the median absolute deviation). 8 of them is past any sample of an exponential tail.

    Parameters
    ----------
    positions, log_prob
        Shapes (n, d) and (n,).
    """
    values = np.column_stack([positions, log_prob])
    gap = np.abs(values - np.median(values, axis=0))
    return np.any(gap > threshold * 1.4826 * np.median(gap, axis=0), axis=1)


def strays(chain: Array, log_prob: Array, tau: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    r"""Walkers that stuck, and walkers that left for another mode, over the second half of a chain.

    A walker is *stuck* if it did not move at all. It *left* if its mean, in a coordinate or in log posterior, differs
    from the median of all walkers' means by more than

    .. math:: \max(6 s \sqrt{\tau / n}, \tfrac32 s, 3 s_w),

    with s the typical and :math:`s_w` its own standard deviation over the n steps looked at: six standard errors, a
    distance that matters, and a place that it does not come back from. Walkers that wander to and fro between modes, or
    that linger in a tail for a while, have not left.

    Parameters
    ----------
    chain, log_prob
        Shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    tau
        Autocorrelation time in steps.

    Returns
    -------
    ``stuck`` and ``left``, shape (ensemble, walker).
    """
    half = chain.shape[1] // 2
    values = np.concatenate([chain, log_prob[..., None]], axis=3)[:, half:]
    count = values.shape[1]
    if count < 10:
        nobody = np.zeros((chain.shape[0], chain.shape[2]), dtype=bool)
        return nobody, nobody
    spread = values.std(axis=1, ddof=1)
    mean = values.mean(axis=1)
    stuck = np.all(np.ptp(values, axis=1) == 0, axis=2)
    common = max(6 * np.sqrt(min(tau, count) / count), 1.5) * np.median(spread, axis=(0, 1))
    limit = np.maximum(common, 3 * spread)
    left = np.any(np.abs(mean - np.median(mean, axis=(0, 1))) > limit, axis=2)
    return stuck, left & ~stuck
