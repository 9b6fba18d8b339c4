r"""The spectrum of a noise: an average over autoregressive processes.

.. math:: S(\omega) = \sigma^2 / |1 + \sum_{k=1}^p a_k e^{-i \omega k}|^2

References
----------
Percival and Walden, "Spectral Analysis for Physical Applications" (1993), ch. 9: Yule-Walker, Whittle's likelihood.
Granger and Joyeux, "An introduction to long-memory time series models", J. Time Series Analysis 1 (1980).
Burnham and Anderson, "Model Selection and Multimodel Inference" (2002), ch. 4: Akaike's weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray

_TINY = np.finfo(float).tiny
#: Least 1 - 2 d at zero frequency: with d from 0.5 on the mean over the bin would have no end.
_LEAST_SPAN = 0.1


@dataclass(frozen=True)
class SpectrumSettings:
    """How the spectrum of a noise is estimated."""

    highest_order: int = 12
    """Of the autoregressive process: six resonances, two coefficients each."""
    memories: tuple[float, ...] = (0.15, 0.3, 0.45, 0.6)
    """Exponents d of long memory that are tried; 1/f noise has 0.5, and lies between two."""
    memory_order: int = 3
    """Highest order of the autoregressive part beside long memory."""
    memory_bins: int = 64
    """Known bins from which long memory can be told from a short one."""
    bins_per_coefficient: int = 8
    """Known bins that each coefficient needs at least; with fewer it fits chance."""
    fill_rounds: int = 4
    """Rounds of expectation-maximisation, which fill unknown bins with the spectrum found."""


SETTINGS = SpectrumSettings()


def autoregressive_spectrum(power: FloatArray, known: NDArray[np.bool_], count: int) -> tuple[FloatArray, FloatArray]:
    r"""Fit processes of order 0 to 12 and average :math:`\log S` over them with Akaike's weights.

    Beside them stand processes with long memory (1/f noise), :math:`|2 \sin(\omega/2)|^{-2d}` times the spectrum of a
    process of low order.

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
    degrees_of_freedom
        Of every bin's estimate, :math:`2 / \mathrm{var}(\log S)`: the variance within a process by Fisher's
        information, and that between them.
    """
    number = int(known.sum())
    if number == 0:
        return np.full(len(power), max(float(power.mean()), _TINY)), np.full(len(power), 2.0)
    highest = max(min(SETTINGS.highest_order, number // SETTINGS.bins_per_coefficient - 1, count // 4), 0)
    turn: NDArray[Any] = -2j * np.pi * np.outer(np.arange(len(power)) / count, np.arange(highest + 1))
    np.exp(turn, out=turn)
    fits = _Fits()
    for fit in _autoregressive(power, known, turn):
        fits.add(fit)
    for exponent in SETTINGS.memories if number >= SETTINGS.memory_bins else ():
        shape = _long_memory(count, exponent)[: len(power)]
        logarithm = np.log(shape)
        # one coefficient more, and as many ways for chance as exponents are tried
        offset = float(np.sum(logarithm[known])) + 1 + np.log(len(SETTINGS.memories))
        for fit in _autoregressive(power / shape, known, turn[:, : SETTINGS.memory_order + 1]):
            fits.add(_Fit(fit.criterion + offset, fit.logarithm + logarithm, fit.variance))
    weighted = fits.weighted()
    mean, variance = np.zeros(len(power)), np.zeros(len(power))
    for weight, fit in weighted:
        mean += weight * fit.logarithm
    for weight, fit in weighted:
        variance += weight * (fit.variance + (fit.logarithm - mean) ** 2)
    return np.exp(mean), np.maximum(2 / np.maximum(variance, 1 / count), 2.0)


@dataclass(frozen=True)
class _Fit:
    """A process: half of Akaike's criterion, log S on the bins, and the variance of that."""

    criterion: float
    logarithm: FloatArray
    variance: FloatArray


class _Fits:
    """Processes that are averaged; those that a better one leaves without any weight are not kept."""

    def __init__(self) -> None:
        self._criteria: list[float] = []
        self._kept: dict[int, _Fit] = {}

    def add(self, fit: _Fit) -> None:
        """One more."""
        self._kept[len(self._criteria)] = fit
        self._criteria.append(fit.criterion)
        # long records tell most of them apart beyond the range of floating-point numbers
        relative = self._relative()
        self._kept = {number: one for number, one in self._kept.items() if relative[number] != 0}

    def weighted(self) -> list[tuple[float, _Fit]]:
        """Those with a weight by Akaike, and this; all weights are 1 together."""
        weights = self._relative()
        weights /= weights.sum()
        return [(weights[number], fit) for number, fit in self._kept.items()]

    def _relative(self) -> FloatArray:
        return np.exp(min(self._criteria) - np.array(self._criteria))


def _autoregressive(power: FloatArray, known: NDArray[np.bool_], turn: NDArray[Any]) -> Iterator[_Fit]:
    """Autoregressive processes of every order; ``turn`` is exp(-i omega lag), (bins, lags)."""
    filled = np.where(known, power, power[known].mean())
    return (_fit(filled, power, known, turn[:, : order + 1]) for order in range(turn.shape[1]))


def _fit(filled: FloatArray, power: FloatArray, known: NDArray[np.bool_], turn: NDArray[Any]) -> _Fit:
    """The process of one order, with as many columns of ``turn`` as it has lags."""
    whitening, spectrum = _fitted(filled, power, known, turn)
    derivatives = np.ones(turn.shape)
    np.multiply(-2, (turn[:, 1:] / whitening[:, None]).real, out=derivatives[:, 1:])
    information = derivatives[known].T @ derivatives[known]
    order = turn.shape[1] - 1
    criterion = float(np.sum(np.log(spectrum[known]) + power[known] / spectrum[known])) + order + 1
    variance = np.sum((derivatives @ np.linalg.pinv(information)) * derivatives, axis=1)
    return _Fit(criterion, np.log(spectrum), variance)


def _fitted(
    filled: FloatArray, power: FloatArray, known: NDArray[np.bool_], turn: NDArray[Any]
) -> tuple[FloatArray, FloatArray]:
    """Transfer function of the whitening filter, and the spectrum, on the bins; ``turn`` is exp(-i omega lag)."""
    lags, order = np.ascontiguousarray(turn.real.T), turn.shape[1] - 1
    apart = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    for _ in range(SETTINGS.fill_rounds):
        covariance = lags @ filled
        a = np.linalg.solve(covariance[apart], -covariance[1:])
        whitening = 1 + turn[:, 1:] @ a
        shape = 1 / np.abs(whitening) ** 2
        spectrum = np.maximum(shape * np.mean(power[known] / shape[known]), _TINY)
        filled = np.where(known, power, spectrum)
    return whitening, spectrum


def _long_memory(count: int, exponent: float) -> FloatArray:
    r"""Spectrum :math:`|2 \sin(\omega/2)|^{-2d}` of fractional noise on the bins; the mean over its bin at zero."""
    omega = 2 * np.pi * np.arange(count // 2 + 1) / count
    shape = np.empty(len(omega))
    shape[1:] = (2 * np.sin(omega[1:] / 2)) ** (-2 * exponent)
    shape[0] = (np.pi / count) ** (-2 * exponent) / max(1 - 2 * exponent, _LEAST_SPAN)
    return shape
