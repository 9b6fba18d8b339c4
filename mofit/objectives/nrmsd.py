"""The paper's objective: normalised root-mean-square deviation, one number per test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def nrmsd(cost: NDArray[np.float64], count: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""NRMSD per test (Hackl et al. 2016, eqs. 10 and 11).

    .. math:: \mathrm{NRMSD} = \frac{1}{\hat F_{\max} - \hat F_{\min}} \sqrt{\frac1n \sum_k (\hat F_k - F_k)^2}

    Parameters
    ----------
    cost
        Sum of squared residuals, each divided by the peak-to-peak range of its measured output; shape (..., tests).
    count
        Number of residuals that count in each test, shape (tests,).

    Returns
    -------
    NDArray
        NRMSD, dimensionless, shape (..., tests); nan where the simulation failed.
    """
    return np.sqrt(cost / count)
