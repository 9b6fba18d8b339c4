r"""Likelihood with each test's noise level marginalised.

Residuals of test :math:`t` are taken as Gaussian with an unknown variance of its own; with Jeffreys' prior
:math:`1/\sigma_t` the variance integrates out:

.. math:: -\log L(\theta) = \sum_t \tfrac{\nu_t}{2} \log C_t(\theta)

where :math:`C_t` is the sum of squared residuals and :math:`\nu_t` the number of *independent* residuals. White noise
has :math:`\nu_t = n_t`; coloured noise or a systematic misfit, which repeats from period to period, has far fewer
(`effective_samples`), and the posterior widens accordingly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Residuals below this share of the output's range are numerical noise; keeps the logarithm finite on perfect data.
RESIDUAL_FLOOR = 1e-9


@dataclass(frozen=True)
class Noise:
    """How many residuals each test has, and how many of them are independent; shapes (tests,)."""

    count: Array
    independent: Array


@dataclass(frozen=True)
class TestSums:
    """Per-test sums at N points: cost (N, T), gradient of cost/2 (N, T, d), Gauss-Newton matrix (N, T, d, d)."""

    __test__ = False  # not a pytest class

    cost: Array
    gradient: Array
    normal: Array


def effective_samples(residuals: Array) -> float:
    r"""Number of independent residuals in a record.

    .. math:: \nu = \min\!\left(n,\; \frac{4\,(\sum_k S_k)^2}{\sum_k S_k^2}\right)

    with the periodogram :math:`S_k`. For white noise the periodogram is exponentially distributed, so that
    :math:`E\,S^2 = 2 (E\,S)^2` and :math:`\nu \to n`; a residual confined to one line has :math:`\nu = 4`.

    Parameters
    ----------
    residuals
        One record, shape (n,).
    """
    power = np.abs(np.fft.rfft(residuals - residuals.mean())[1:]) ** 2
    total = power.sum()
    if not total > 0:
        return float(len(residuals))
    return float(min(len(residuals), 4 * total**2 / (power**2).sum()))


def negative_log_likelihood(cost: Array, noise: Noise) -> Array:
    """Negative log likelihood up to a constant, shape (N,), from the costs (N, T); nan where a test failed."""
    floor = noise.count * RESIDUAL_FLOOR**2
    return np.sum(0.5 * noise.independent * np.log(cost / noise.count + floor / noise.count), axis=-1)


def likelihood_terms(sums: TestSums, noise: Noise) -> tuple[Array, Array, Array]:
    r"""Negative log likelihood (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d).

    .. math:: \nabla = \sum_t \nu_t g_t / C_t, \qquad H \approx \sum_t \nu_t N_t / C_t

    The Hessian leaves out :math:`-2 \nu_t g_t g_t^T / C_t^2`, which vanishes where every test is at its minimum, and
    stays positive semi-definite.
    """
    share = noise.independent / (sums.cost + noise.count * RESIDUAL_FLOOR**2)
    return (
        negative_log_likelihood(sums.cost, noise),
        np.einsum("nt,ntd->nd", share, sums.gradient),
        np.einsum("nt,ntde->nde", share, sums.normal),
    )
