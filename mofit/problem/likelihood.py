r"""Objectives and likelihood of all tests: relative noise levels known, overall level marginalised.

The objective of a test is its NRMSD (`nrmsd`). Of a model with several outputs each output that was measured in a test
is an objective of its own, with its own noise; "test" stands for such a pair below.

Residuals of test :math:`t`, relative to the range of its output, are Gaussian with variance :math:`s^2 v_t`. The
relative variances :math:`v_t` are fixed beforehand (`Noise`): the test's noise floor plus a gap common to all tests.
The overall level :math:`s` is unknown and integrated out under Jeffreys' prior :math:`1/s`:

.. math:: -\log L(\theta) = \tfrac{\nu}{2} \log Q(\theta), \qquad
          Q = \sum_t \frac{\nu_t}{n_t v_t} C_t(\theta), \quad \nu = \sum_t \nu_t

with :math:`C_t` the sum of squared residuals, :math:`n_t` their number and :math:`\nu_t` how many of them are
*independent*. White noise has :math:`\nu_t = n_t`; coloured noise or a systematic misfit, which repeats from period to
period, has far fewer (`mofit.data.signals.effective_samples`), and the posterior widens accordingly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from mofit._typing import FloatArray

#: Residuals below this share of the output's range are numerical noise; keeps the logarithm finite on perfect data.
RESIDUAL_FLOOR = 1e-9


@dataclass(frozen=True)
class Noise:
    """What is known of the residuals of each objective; shapes (objectives,)."""

    count: FloatArray
    """Residuals that count."""
    floor: FloatArray
    """NRMSD of the noise alone, from repeated periods."""
    independent: FloatArray
    """How many residuals are independent; all of them, to begin with."""
    gap: float = np.inf
    """NRMSD of what the model misses, common to all objectives; infinite, to begin with: equal weight for every NRMSD²,
    the paper's objective."""
    absorbed: int = 0
    """Scoped values that are fitted along: each takes a residual's information."""
    memory: FloatArray | None = None
    """What other records of the same noise tell of its long memory (`mofit.data.signals.NoiseProcess`), if they do;
    (objectives, M)."""

    @property
    def variance(self) -> FloatArray:
        """Relative variances v_t, up to a common factor."""
        if np.isinf(self.gap):
            return np.ones_like(self.floor)
        return self.floor**2 + self.gap**2 + RESIDUAL_FLOOR**2

    @property
    def weights(self) -> FloatArray:
        """Weight of each objective's squares."""
        return np.asarray(self.independent / (self.count * self.variance))

    def select(self, index: list[int]) -> Noise:
        """The noise of some of the objectives."""
        memory = None if self.memory is None else self.memory[index]
        chosen = replace(self, count=self.count[index], floor=self.floor[index], independent=self.independent[index])
        return replace(chosen, memory=memory)

    def at(self, nrmsd: FloatArray, independent: FloatArray) -> Noise:
        """Noise as seen at a point: independent residuals counted there, gap estimated from the NRMSD there."""
        return replace(self, independent=independent, gap=common_gap(nrmsd, self.floor, independent))


@dataclass(frozen=True)
class TestSums:
    """Sums per objective at N points: cost (N, T), gradient of cost/2 (N, T, d), Gauss-Newton matrix (N, T, d, d)."""

    __test__ = False  # not a pytest class

    cost: FloatArray
    gradient: FloatArray
    normal: FloatArray


def nrmsd(cost: FloatArray, count: FloatArray) -> FloatArray:
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
    FloatArray
        NRMSD, dimensionless, shape (..., tests); nan where the simulation failed.
    """
    return np.sqrt(cost / count)


def common_gap(nrmsd: FloatArray, floor: FloatArray, independent: FloatArray) -> float:
    r"""Maximum-likelihood gap :math:`m \ge 0` of :math:`\mathrm{NRMSD}_t^2 \sim f_t^2 + m^2`.

    Solves :math:`\sum_t \nu_t (v_t - \mathrm{NRMSD}_t^2) / v_t^2 = 0`, :math:`v_t = f_t^2 + m^2`, with the noise floors
    f and :math:`\nu_t` independent residuals; 0 where the floors alone explain the residuals.
    """
    base = floor**2 + RESIDUAL_FLOOR**2

    def excess(square: float) -> float:
        variance = base + square
        return float(np.sum(independent * (variance - nrmsd**2) / variance**2))

    largest = float(np.max(nrmsd**2))
    if excess(0.0) >= 0 or largest == 0:
        return 0.0
    return float(np.sqrt(brentq(excess, 0.0, largest, rtol=1e-12)))


def _weights(noise: Noise) -> tuple[FloatArray, float, float]:
    """Weight of each test's cost in Q, the number of independent residuals, and what perfect data leave of Q."""
    weights = noise.weights
    independent = max(float(noise.independent.sum()) - noise.absorbed, 1.0)
    return weights, independent, float(np.sum(weights * noise.count) * RESIDUAL_FLOOR**2)


def negative_log_likelihood(cost: FloatArray, noise: Noise) -> FloatArray:
    """Negative log likelihood up to a constant, shape (N,), from the costs (N, T); nan where a test failed."""
    weights, independent, rest = _weights(noise)
    return np.asarray(0.5 * independent * np.log(cost @ weights + rest))


def likelihood_terms(sums: TestSums, noise: Noise) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Negative log likelihood (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d).

    .. math:: \nabla = \frac{\nu}{Q} \sum_t w_t g_t, \qquad H \approx \frac{\nu}{Q} \sum_t w_t N_t

    with :math:`w_t = \nu_t / (n_t v_t)`. The Hessian leaves out :math:`-2 \nabla \nabla^T / \nu`, which vanishes at the
    minimum, and stays positive semi-definite.
    """
    weights, independent, rest = _weights(noise)
    scale = independent / (sums.cost @ weights + rest)
    return (
        negative_log_likelihood(sums.cost, noise),
        scale[:, None] * np.einsum("t,ntd->nd", weights, sums.gradient),
        scale[:, None, None] * np.einsum("t,ntde->nde", weights, sums.normal),
    )


def test_log_likelihood(cost: FloatArray, best: FloatArray, noise: Noise) -> FloatArray:
    r"""Log likelihood per test :math:`-\tfrac12 w_t C_t / s^2`, shape (N, T), the level s as at the best point (T,)."""
    weights, independent, rest = _weights(noise)
    return np.asarray(-0.5 * cost * weights * independent / (best @ weights + rest))


test_log_likelihood.__test__ = False  # type: ignore[attr-defined]  # not a pytest function
