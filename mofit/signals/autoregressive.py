r"""The spectrum of a noise as that of an autoregressive process, from the bins of a periodogram that are known.

.. math:: S(\omega) = \sigma^2 / |1 + \sum_{k=1}^p a_k e^{-i \omega k}|^2

References
----------
Percival and Walden, "Spectral Analysis for Physical Applications" (1993), ch. 9: Yule-Walker, Whittle's likelihood.
Burnham and Anderson, "Model Selection and Multimodel Inference" (2002), ch. 4: Akaike's weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

Array = NDArray[np.float64]

#: Highest order that is tried; at least so many known bins for every coefficient.
_HIGHEST, _BINS = 12, 8
#: Rounds in which unknown bins are filled with the spectrum found (expectation-maximisation).
_ROUNDS = 4


def autoregressive_spectrum(power: Array, known: NDArray[np.bool_], count: int) -> tuple[Array, Array]:
    r"""Fit processes of order 0 to 12 and average :math:`\log S` over them with Akaike's weights.

    Parameters
    ----------
    power
        Periodogram :math:`|X_k|^2 / n` on the bins of the real FFT, shape (n // 2 + 1,).
    known
        Bins that are noise alone.
    count
        Number of samples n.

    Returns
    -------
    spectrum
        S on the bins.
    freedom
        Degrees of freedom of every bin's estimate, :math:`2 / \mathrm{var}(\log S)`: the variance within a process by
        Fisher's information, and that between them.
    """
    number = int(known.sum())
    if number == 0:
        return np.full(len(power), max(float(power.mean()), np.finfo(float).tiny)), np.full(len(power), 2.0)
    turn = np.exp(-2j * np.pi * np.outer(np.arange(len(power)) / count, np.arange(_HIGHEST + 1)))
    filled = np.where(known, power, power[known].mean())
    criteria, logarithms, variances = [], [], []
    for order in range(max(min(_HIGHEST, number // _BINS - 1, count // 4), 0) + 1):
        whitening, spectrum = _fitted(filled, power, known, turn[:, : order + 1])
        slopes = np.concatenate(
            [np.ones((len(power), 1)), -2 * (turn[:, 1 : order + 1] / whitening[:, None]).real], axis=1
        )
        information = slopes[known].T @ slopes[known]
        criteria.append(float(np.sum(np.log(spectrum[known]) + power[known] / spectrum[known])) + order + 1)
        logarithms.append(np.log(spectrum))
        variances.append(np.einsum("ki,ij,kj->k", slopes, np.linalg.pinv(information), slopes))
    weights = np.exp(min(criteria) - np.array(criteria))
    weights /= weights.sum()
    mean = weights @ np.array(logarithms)
    variance = weights @ (np.array(variances) + (np.array(logarithms) - mean) ** 2)
    return np.exp(mean), np.maximum(2 / np.maximum(variance, 1 / count), 2.0)


def _fitted(filled: Array, power: Array, known: NDArray[np.bool_], turn: Array) -> tuple[Array, Array]:
    """Transfer function of the whitening filter, and the spectrum, on the bins; ``turn`` is exp(-i omega lag)."""
    lags = np.ascontiguousarray(turn.real.T)
    for _ in range(_ROUNDS):
        covariance = lags @ filled
        a = solve_toeplitz(covariance[:-1], -covariance[1:]) if len(lags) > 1 else np.empty(0)
        whitening = 1 + turn[:, 1:] @ a
        shape = 1 / np.abs(whitening) ** 2
        spectrum = np.maximum(shape * np.mean(power[known] / shape[known]), np.finfo(float).tiny)
        filled = np.where(known, power, spectrum)
    return whitening, spectrum
