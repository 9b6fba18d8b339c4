"""Homogeneity of independent estimates: Cochran's Q."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from mofit._typing import FloatArray


def cochran(estimate: FloatArray, sd: FloatArray) -> tuple[float, float, float, float, float]:
    r"""Pooled mean, its sd, Cochran's Q, its p value and I² of independent estimates (k,).

    .. math:: \bar x = \frac{\sum x_i / \sigma_i^2}{\sum 1 / \sigma_i^2}, \quad
              Q = \sum \frac{(x_i - \bar x)^2}{\sigma_i^2} \sim \chi^2_{k-1}, \quad
              I^2 = \max\left(0, \frac{Q - (k - 1)}{Q}\right)

    Notes
    -----
    I² is the share of the scatter between the estimates that their standard deviations do not explain. p and I² are nan
    for fewer than two estimates.

    References
    ----------
    Cochran: The combination of estimates from different experiments, Biometrics 10 (1954). Higgins, Thompson:
    Quantifying heterogeneity in a meta-analysis, Statistics in Medicine 21 (2002).
    """
    if len(estimate) == 0:
        return (float("nan"),) * 5
    weight = 1 / sd**2
    mean = float(np.sum(weight * estimate) / np.sum(weight))
    q = float(np.sum(weight * (estimate - mean) ** 2))
    freedom = len(estimate) - 1
    pooled = float(1 / np.sqrt(np.sum(weight)))
    if freedom < 1:
        return mean, pooled, q, float("nan"), float("nan")
    return mean, pooled, q, float(chdtrc(freedom, q)), max(0.0, 1 - freedom / q) if q > 0 else 0.0
