"""Expected discrimination between candidate models by one more experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from mofit._typing import FloatArray


@dataclass(frozen=True)
class LinearisedExperiment:
    r"""The responses of K models in an experiment not yet run, as linear Gaussian models.

    Parameters
    ----------
    products
        Inner products per second of the responses :math:`y_k` and of their derivatives :math:`J_k` by the free
        parameters, in standard deviations of the noise: of the columns :math:`[y_1 \dots y_K, J_1 \dots J_K]`.
    known
        Hessian per model of all that was measured before, (d_k, d_k).
    """

    products: FloatArray
    known: Sequence[FloatArray]

    def discrimination(self, right: int, wrong: int, seconds: float) -> tuple[float, float]:
        r"""Mean and variance of the difference of both models' sums of squares that the experiment adds.

        Both are fitted again, to the old tests and the new one. The new data are :math:`y_k + J_k \Delta + e` with
        :math:`\Delta \sim N(0, H_k^{-1})`, as far as the right model k is known now. With :math:`d = y_k - y_l`,
        :math:`M_l = (I + J_l H_l^{-1} J_l^T)^{-1}` and :math:`C = I + J_k H_k^{-1} J_k^T`, the wrong model's sum of
        squares less the right one's has

        .. math::
            \text{mean } d^T M_l d + \mathrm{tr}(M_l C - I), \qquad
            \text{variance } 4 \, d^T M_l C M_l d + 2 \, \mathrm{tr}\,(M_l C - I)^2

        Half of the mean is the expected log Bayes factor; its first term is the noncentrality of T-optimality.

        Parameters
        ----------
        right, wrong
            Numbers of the models k and l.
        seconds
            Length of the experiment.

        References
        ----------
        Atkinson, Fedorov: The design of experiments for discriminating between two rival models. Biometrika 62 (1975).
        """
        own, other = self._columns(right), self._columns(wrong)
        products = seconds * self.products
        difference = products[:, right] - products[:, wrong]
        adapts = np.linalg.inv(self.known[wrong] + products[other, other])
        covariance = np.linalg.inv(self.known[right])
        shift = adapts @ difference[other]
        rest = difference[own] - products[own, other] @ shift
        power = difference[right] - difference[wrong] - difference[other] @ shift
        variance = power - shift @ difference[other] + shift @ products[other, other] @ shift + rest @ covariance @ rest
        # M C - I is U V with the derivatives U = [J_l, J_k]: its traces are those of the small V U
        upper = -adapts @ products[other]
        lower = covariance @ products[own]
        upper = upper + upper[:, own] @ lower
        turned = np.block([[upper[:, other], upper[:, own]], [lower[:, other], lower[:, own]]])
        return float(power + np.trace(turned)), float(4 * variance + 2 * np.trace(turned @ turned))

    def _columns(self, which: int) -> slice:
        """Columns of a model's derivatives."""
        sizes = [len(hessian) for hessian in self.known]
        start = len(sizes) + sum(sizes[:which])
        return slice(start, start + sizes[which])


def linearise(
    responses: Sequence[FloatArray], derivatives: Sequence[FloatArray], known: Sequence[FloatArray], seconds: float
) -> LinearisedExperiment:
    """From responses (n,) and derivatives (n, d_k) of every model, in standard deviations of the noise."""
    columns = np.concatenate([np.stack(responses, axis=1), *derivatives], axis=1)
    return LinearisedExperiment(columns.T @ columns / seconds, known)


def rejection_probability(mean: FloatArray, variance: FloatArray, prior: FloatArray, odds: float) -> FloatArray:
    r"""Probability that the experiment rules out model l if model k is right, (..., k, l).

    A model is ruled out if it is ``odds`` times less probable than the right one.

    Parameters
    ----------
    mean, variance
        Of the difference of the sums of squares, twice that in log likelihood, shape (..., k, l); an infinite mean
        where there is nothing to distinguish.
    prior
        Probability of each model before the experiment, (k,).
    odds
        Times less probable.
    """
    share = np.log(np.maximum(prior, 1e-300))
    ahead = 2 * (share[:, None] - share)
    return np.asarray(ndtr((mean + ahead - 2 * np.log(odds)) / np.sqrt(np.maximum(variance, 1e-9))))
