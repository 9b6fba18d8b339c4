r"""The spectrum of a noise: an average over autoregressive processes.

.. math:: S(\omega) = \sigma^2 / |1 + \sum_{k=1}^p a_k e^{-i \omega k}|^2

References
----------
Percival and Walden, "Spectral Analysis for Physical Applications" (1993), ch. 9: Yule-Walker, Whittle's likelihood.
Granger and Joyeux, "An introduction to long-memory time series models", J. Time Series Analysis 1 (1980).
Sykulski et al., "The debiased Whittle likelihood", Biometrika 106 (2019): expected periodograms.
Burnham and Anderson, "Model Selection and Multimodel Inference" (2002), ch. 4: Akaike's weights.
Patterson and Thompson, "Recovery of inter-block information when block sizes are unequal", Biometrika 58 (1971): REML.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, gammaln, softmax

from mofit._typing import FloatArray
from mofit.data.signals.contrasts import Contrasts

_TINY = np.finfo(float).tiny
#: Least 1 - 2 d at zero frequency: with d from 0.5 on the mean over the bin would have no end.
_LEAST_SPAN = 0.1
#: At 0.5 itself the covariance has no end; but for a constant it is that of the exponents beside it.
_BESIDE = 1e-6


@dataclass(frozen=True)
class SpectrumSettings:
    """How the spectrum of a noise is estimated."""

    highest_order: int = 12
    """Of the autoregressive process: six resonances, two coefficients each."""
    memories: tuple[float, ...] = (0.2, 0.3, 0.4, 0.5, 0.6)
    """Exponents d of long memory that are tried; 1/f noise has 0.5. A record of 1000 samples tells d within 0.025:
    far beside the right one a process of short memory fits as well."""
    memory_order_of_rest: int = 3
    """Highest order beside long memory in a record that does not repeat."""
    memory_bins: int = 64
    """Known bins from which long memory can be told from a short one."""
    bins_per_coefficient: int = 8
    """Known bins that each coefficient needs at least; with fewer it fits chance."""
    fill_rounds: int = 4
    """Most rounds of expectation-maximisation, which fill unknown bins with the spectrum found."""
    settled: float = 0.01
    """Relative change of the spectrum up to which another round is not worth its time."""


SETTINGS = SpectrumSettings()


@dataclass(frozen=True)
class SpectrumEstimate:
    r"""The spectrum of a noise by processes of every memory that was tried: exponents d of 0 and `memories`.

    Each is :math:`\log S` on the bins and the variance of that, (2, n // 2 + 1).
    """

    by_memory: tuple[FloatArray, ...]
    """Of exponent 0, and of the others in a record that may tell them."""
    memory: FloatArray
    """Log of Akaike's weight of every exponent (M,), relative to that of 0, by this record alone."""

    def averaged(self, others: FloatArray | float = 0.0) -> tuple[FloatArray, FloatArray]:
        r"""Spectrum S and its degrees of freedom, :math:`2 / \mathrm{var}(\log S)`, on the bins.

        The variance is that within a process by Fisher's information, and that between them. ``others``: sum of
        `memory` (M,) over the other records of the same noise, which has one exponent in all of them.
        """
        logarithms = self.memory + others
        # one coefficient more, and as many ways for chance as exponents are tried
        logarithms[1:] -= 1 + np.log(len(logarithms) - 1)
        weights = softmax(logarithms[: len(self.by_memory)])
        mean, variance = _mixed(list(zip(weights.tolist(), self.by_memory, strict=True)))
        return np.exp(mean), np.maximum(2 / np.maximum(variance, 0.5 / len(mean)), 2.0)


def autoregressive_spectrum(
    lines: NDArray[Any],
    known: NDArray[np.bool_],
    count: int,
    fitted: NDArray[Any] | None = None,
    memory_order: int = SETTINGS.highest_order,
) -> SpectrumEstimate:
    r"""Fit processes of order 0 to 12 and average :math:`\log S` over them with Akaike's weights.

    Beside them stand processes with long memory (1/f noise), :math:`|2 \sin(\omega/2)|^{-2d}` times these spectra
    up to ``memory_order``.

    A fit has drawn the lines of its residual towards zero where its signals have their power, most on the lowest.
    Restricted maximum likelihood (REML) takes only what no such signal changes.

    Parameters
    ----------
    lines
        Fourier transform of the residual, :math:`X_k / \sqrt n`, on the bins of the real FFT, shape (n // 2 + 1,).
    known
        Bins that are noise alone.
    count
        Number of samples n.
    fitted
        The same transform of signals whose coefficients were fitted, shape (n // 2 + 1, d).
    memory_order
        Highest order of the process beside long memory.
    """
    number, power = int(known.sum()), np.abs(lines) ** 2
    if number == 0:
        level = np.full(len(power), np.log(max(float(power.mean()), _TINY)))
        return SpectrumEstimate((np.stack([level, np.ones(len(level))]),), no_memory())
    highest = max(min(SETTINGS.highest_order, number // SETTINGS.bins_per_coefficient - 1, count // 4), 0)
    turn: NDArray[Any] = -2j * np.pi * np.outer(np.arange(len(power)) / count, np.arange(highest + 1))
    np.exp(turn, out=turn)
    record = Contrasts.of(lines, known, fitted)
    found = [_Fits(_autoregressive(record, np.ones(len(power)), turn))]
    for exponent in SETTINGS.memories if number >= SETTINGS.memory_bins else ():
        shape = _long_memory(count, exponent)[: len(power)]
        found.append(_Fits(_autoregressive(record, shape, turn[:, : memory_order + 1])))
    memory = no_memory()
    memory[: len(found)] = [one.log_weight - found[0].log_weight for one in found]
    return SpectrumEstimate(tuple(one.averaged() for one in found), memory)


def no_memory() -> FloatArray:
    """What a record tells of the exponent that tells nothing, (M,)."""
    return np.zeros(1 + len(SETTINGS.memories))


@dataclass(frozen=True)
class _Fit:
    """A process: half of Akaike's criterion, log S on the bins, and the variance of that."""

    criterion: float
    logarithm: FloatArray
    variance: FloatArray


class _Fits:
    """Processes that are averaged; those that a better one leaves without any weight are not kept."""

    def __init__(self, fits: Iterable[_Fit]) -> None:
        self._criteria: list[float] = []
        self._kept: dict[int, _Fit] = {}
        for fit in fits:
            self._kept[len(self._criteria)] = fit
            self._criteria.append(fit.criterion)
            # long records tell most of them apart beyond the range of floating-point numbers
            relative = self._relative()
            self._kept = {number: one for number, one in self._kept.items() if relative[number] != 0}

    def averaged(self) -> FloatArray:
        """Log S and its variance by Akaike's weights, (2, bins)."""
        weights = self._relative()
        weights /= weights.sum()
        return _mixed([(weights[n], np.stack([one.logarithm, one.variance])) for n, one in self._kept.items()])

    @property
    def log_weight(self) -> float:
        """Logarithm of the sum of all weights."""
        return float(np.log(self._relative().sum()) - min(self._criteria))

    def _relative(self) -> FloatArray:
        return np.exp(min(self._criteria) - np.array(self._criteria))


def _mixed(parts: Sequence[tuple[float, FloatArray]]) -> FloatArray:
    """Mean and variance (2, bins) of a mixture: of each part its weight, mean and variance."""
    mean, variance = np.zeros_like(parts[0][1])
    for weight, (own, _) in parts:
        mean += weight * own
    for weight, (own, within) in parts:
        variance += weight * (within + (own - mean) ** 2)
    return np.stack([mean, variance])


def _autoregressive(record: Contrasts, shape: FloatArray, turn: NDArray[Any]) -> Iterator[_Fit]:
    """Autoregressive processes of every order, times a shape (bins,); ``turn`` is exp(-i omega lag), (bins, lags)."""
    return (_fit(record, shape, turn[:, : order + 1]) for order in range(turn.shape[1]))


def _fit(record: Contrasts, shape: FloatArray, turn: NDArray[Any]) -> _Fit:
    """The process of one order, with as many columns of ``turn`` as it has lags."""
    whitening, spectrum = _fitted(record, shape, turn)
    left = record.beside_fitted(spectrum)
    derivatives = np.ones(turn.shape)
    np.multiply(-2, (turn[:, 1:] / whitening[:, None]).real, out=derivatives[:, 1:])
    # the square root of the share of a line that the fit has left
    weighted = derivatives * np.sqrt(np.clip(1 - left.absorbed / spectrum, 0.0, 1.0) * record.known)[:, None]
    order, known = turn.shape[1] - 1, record.known
    squares = float(np.sum(np.log(spectrum[known]) + left.power[known] / spectrum[known]))
    variance = np.sum((derivatives @ np.linalg.pinv(weighted.T @ weighted)) * derivatives, axis=1)
    return _Fit(squares + 0.5 * left.log_information + order + 1, np.log(spectrum), variance)


def _fitted(record: Contrasts, shape: FloatArray, turn: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
    """Transfer function of the whitening filter, and the spectrum, on the bins; ``turn`` is exp(-i omega lag).

    Expectation-maximisation: what is unknown, on bins or behind a fit, is filled as the spectrum lets expect.
    """
    lags, order = np.ascontiguousarray(turn.real.T), turn.shape[1] - 1
    apart = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    spectrum = record.scaled(shape)
    for _ in range(SETTINGS.fill_rounds):
        left = record.beside_fitted(spectrum)
        covariance = lags @ (np.where(record.known, left.power + left.absorbed, spectrum) / shape)
        a = np.linalg.solve(covariance[apart], -covariance[1:])
        whitening, before = 1 + turn[:, 1:] @ a, spectrum
        spectrum = record.scaled(shape / np.abs(whitening) ** 2)
        if np.max(np.abs(spectrum - before) / before) < SETTINGS.settled:
            break
    return whitening, spectrum


def _long_memory(count: int, exponent: float) -> FloatArray:
    r"""Expected periodogram of fractional noise on the bins, (n // 2 + 1,); at zero the mean over its bin.

    .. math:: E I_k = \sum_{|\tau| < n} (1 - |\tau| / n) \gamma_\tau e^{-i \omega_k \tau}, \quad
              \gamma_\tau = \frac{\Gamma(1 - 2d) \, \Gamma(\tau + d)}{\Gamma(d) \Gamma(1 - d) \Gamma(\tau + 1 - d)}

    It exceeds the spectrum :math:`|2 \sin(\omega/2)|^{-2d}` on the lowest lines, to which what is slower leaks. From
    0.5 on the noise is not stationary; but of a constant, which makes the difference, other lines hold nothing.
    """
    lag = np.arange(count)
    exponent -= _BESIDE * (exponent == 0.5)
    covariance = np.exp(gammaln(lag + exponent) - gammaln(lag + 1 - exponent))
    covariance *= gamma(1 - 2 * exponent) / (gamma(exponent) * gamma(1 - exponent)) * (1 - lag / count)
    shape = 2 * np.fft.rfft(covariance).real - covariance[0]
    shape[0] = (np.pi / count) ** (-2 * exponent) / max(1 - 2 * exponent, _LEAST_SPAN)
    return shape
