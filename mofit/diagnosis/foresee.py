"""How far ahead of its rivals an explanation will be after one more test, should it be the right one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Foreseen:
    r"""What K explanations answer in a test not yet run, as linear Gaussian models.

    Parameters
    ----------
    products
        Inner products per second of the answers :math:`y_k` and of their slopes :math:`J_k` by the free parameters, in
        standard deviations of the noise: of the columns :math:`[y_1 \dots y_K, J_1 \dots J_K]`.
    known
        Hessian per explanation of all that was measured before, (d_k, d_k).
    """

    products: Array
    known: Sequence[Array]

    def lead(self, right: int, wrong: int, seconds: float) -> tuple[float, float]:
        r"""Mean and variance of the lead in squares that the right explanation gains over a wrong one.

        Both are fitted anew, to the old tests and the new one. What is measured is
        :math:`y_k + J_k \Delta + e` with :math:`\Delta \sim N(0, H_k^{-1})`, as far as k is known now. With
        :math:`d = y_k - y_l`, :math:`M_l = (I + J_l H_l^{-1} J_l^T)^{-1}` and :math:`C = I + J_k H_k^{-1} J_k^T` the
        lead has

        .. math::
            \text{mean } d^T M_l d + \mathrm{tr}(M_l C - I), \qquad
            \text{variance } 4 \, d^T M_l C M_l d + 2 \, \mathrm{tr}\,(M_l C - I)^2

        the first term being the noncentrality of T-optimality (Atkinson & Fedorov 1975).

        Parameters
        ----------
        right, wrong
            Numbers of the explanations k and l.
        seconds
            Length of the test.
        """
        own, other = self._slopes(right), self._slopes(wrong)
        products = seconds * self.products
        pull = products[:, right] - products[:, wrong]
        adapts = np.linalg.inv(self.known[wrong] + products[other, other])
        doubt = np.linalg.inv(self.known[right])
        shift = adapts @ pull[other]
        rest = pull[own] - products[own, other] @ shift
        power = pull[right] - pull[wrong] - pull[other] @ shift
        spread = power - shift @ pull[other] + shift @ products[other, other] @ shift + rest @ doubt @ rest
        # M C - I is U V with the slopes U = [J_l, J_k]: its traces are those of the small V U
        upper = -adapts @ products[other]
        lower = doubt @ products[own]
        upper = upper + upper[:, own] @ lower
        turned = np.block([[upper[:, other], upper[:, own]], [lower[:, other], lower[:, own]]])
        return float(power + np.trace(turned)), float(4 * spread + 2 * np.trace(turned @ turned))

    def _slopes(self, which: int) -> slice:
        """Columns of an explanation's slopes."""
        sizes = [len(hessian) for hessian in self.known]
        start = len(sizes) + sum(sizes[:which])
        return slice(start, start + sizes[which])


def foresee(answers: Sequence[Array], slopes: Sequence[Array], known: Sequence[Array], seconds: float) -> Foreseen:
    """From answers (n,) and slopes (n, d_k) of every explanation, in standard deviations of the noise."""
    columns = np.concatenate([np.stack(answers, axis=1), *slopes], axis=1)
    return Foreseen(columns.T @ columns / seconds, known)


def ruled_out(mean: Array, variance: Array, likely: Array, odds: float) -> Array:
    r"""Chance that a rival l is so many times less probable after the test than the explanation k that is right.

    Parameters
    ----------
    mean, variance
        Of the lead in squares, twice that in log likelihood, shape (..., k, l); an infinite mean where there is nothing
        to part.
    likely
        Probability of each explanation before the test, (k,).
    odds
        Times less probable.
    """
    share = np.log(np.maximum(likely, 1e-300))
    ahead = 2 * (share[:, None] - share)
    return np.asarray(norm.cdf((mean + ahead - 2 * np.log(odds)) / np.sqrt(np.maximum(variance, 1e-9))))
