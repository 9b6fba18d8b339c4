"""Measurement noise of the virtual rig."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


def noise(
    signal: Array,
    rng: np.random.Generator,
    *,
    sd: float = 0.0,
    fraction: float = 0.0,
    level: float = 0.0,
    coloured_sd: float = 0.0,
    coefficient: float = 0.9,
) -> Array:
    r"""Noise to be added to ``signal`` (n,), in its unit; independent Gaussian parts.

    .. math::
        e_k = \left(s + f R + l |y_k|\right) n_k + s_c a_k, \qquad
        a_k = \phi a_{k-1} + \sqrt{1 - \phi^2} \, m_k

    with white :math:`n, m` of unit variance, the peak-to-peak range :math:`R`, and :math:`a` stationary, so that
    ``coloured_sd`` :math:`s_c` is the standard deviation of its part.
    """
    white, drive = rng.standard_normal((2, len(signal)))
    drive[1:] *= np.sqrt(1 - coefficient**2)
    coloured = lfilter([1.0], [1.0, -coefficient], drive)
    return np.asarray((sd + fraction * np.ptp(signal) + level * np.abs(signal)) * white + coloured_sd * coloured)
