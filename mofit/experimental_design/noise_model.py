"""The noise that a test will have: as a plan states it for a channel, or as a record shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from mofit._typing import FloatArray
from mofit.data.signals import NoiseProcess

#: Correlations from sample to sample that are tried; between them the fit hardly changes.
_COEFFICIENTS = (0.5, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96, 0.98, 0.99)
#: Degrees of freedom of a spectrum that is known, not estimated.
KNOWN = 1e9


class NoiseModel(Protocol):
    """Noise of one output of a test."""

    def __call__(self, signal: FloatArray, used: NDArray[np.bool_]) -> tuple[NoiseProcess, ...]:
        """Independent parts of the noise over the samples used in the fit, (n,) bool; of the simulated record, (n,)."""


@dataclass(frozen=True)
class ChannelNoise:
    r"""Noise of one channel, as in the ``[noise]`` block of a plan, in SI units.

    .. math::
        e_k = \left(s + f R + l |y_k|\right) n_k + s_c a_k, \qquad a_k = \phi a_{k-1} + \sqrt{1 - \phi^2} \, m_k
    """

    sd: float = 0.0
    """Standard deviation s of the white part."""
    fraction: float = 0.0
    """Share f of the peak-to-peak range R of the test's signal, added to ``sd``."""
    level: float = 0.0
    """Share l of the signal's magnitude."""
    coloured_sd: float = 0.0
    coefficient: float = 0.9
    """Standard deviation of the autoregressive part, and its correlation from sample to sample. The part is taken
    as periodic over the record."""

    def __call__(self, signal: FloatArray, used: NDArray[np.bool_]) -> tuple[NoiseProcess, ...]:
        """See `NoiseModel`."""
        count = int(np.count_nonzero(used))
        white = self.sd + self.fraction * float(np.ptp(signal)) + self.level * np.abs(signal[used])
        size = max(float(np.sqrt(np.mean(white**2))), np.finfo(float).tiny)
        parts = [known_process(white / size, np.full(count // 2 + 1, size**2))]
        if self.coloured_sd > 0:
            angle = 2 * np.pi * np.arange(count // 2 + 1) / count
            response = np.abs(1 - self.coefficient * np.exp(-1j * angle)) ** 2
            spectrum = self.coloured_sd**2 * (1 - self.coefficient**2) / response
            parts.append(known_process(np.ones(count), spectrum))
        return tuple(parts)


#: Where the noise is not stated.
DEFAULT_NOISE = ChannelNoise(fraction=0.01)


@dataclass(frozen=True)
class MeasuredNoise:
    """Noise as a record shows it, whatever the parameters."""

    process: NoiseProcess

    def __call__(self, signal: FloatArray, used: NDArray[np.bool_]) -> tuple[NoiseProcess, ...]:
        """See `NoiseModel`."""
        return (known_process(self.process.level, self.process.spectrum),)


def known_process(level: FloatArray, spectrum: FloatArray) -> NoiseProcess:
    """A known noise process: level (n,), and spectrum on the bins of the real FFT."""
    nothing = np.empty(0)
    return NoiseProcess(level, spectrum, np.full(len(spectrum), KNOWN), nothing.astype(np.int64), nothing)


def channel_noise(found: Sequence[NoiseProcess], steps: Sequence[float]) -> ChannelNoise:
    """Noise of a test that was not run, from the spectra of others: a white and an autoregressive part.

    The noise found is that of one output in every test. Correlations are given for the shortest of the sampling
    intervals ``steps`` [s].
    """
    step = min(steps)
    bins = np.concatenate([np.arange(len(part.spectrum)) / part.count * step / own
                           for part, own in zip(found, steps, strict=True)])  # fmt: skip
    spectrum = np.concatenate([part.spectrum for part in found])
    weights = np.concatenate([np.full(len(part.spectrum), 1 / len(part.spectrum)) for part in found]) / spectrum**2
    best, sizes, coefficient = np.inf, np.array([np.average(spectrum), 0.0]), 0.9
    for trial in _COEFFICIENTS:
        coloured = (1 - trial**2) / np.abs(1 - trial * np.exp(-2j * np.pi * bins)) ** 2
        terms = np.stack([np.ones_like(bins), coloured], axis=1) * np.sqrt(weights)[:, None]
        answer, misfit = nnls(terms, spectrum * np.sqrt(weights))
        if misfit < best:
            best, sizes, coefficient = misfit, answer, float(trial)
    white, coloured_sd = np.sqrt(sizes)
    return ChannelNoise(sd=float(white), coloured_sd=float(coloured_sd), coefficient=coefficient)


def combined(parts: tuple[NoiseProcess, ...]) -> NoiseProcess:
    """One process for independent parts: exact where their levels are constant."""
    if len(parts) == 1:
        return parts[0]
    variance = np.sum([part.level**2 * mean_variance(part) for part in parts], axis=0)
    return known_process(np.sqrt(variance / np.mean(variance)), np.sum([part.spectrum for part in parts], axis=0))


def mean_variance(part: NoiseProcess) -> float:
    """Mean variance of a process."""
    return float(np.sum(bin_weights(part.count) * part.spectrum) / part.count)


def bin_weights(count: int) -> FloatArray:
    """How often every bin of the real FFT of ``count`` samples occurs in the full one."""
    weights = np.full(count // 2 + 1, 2.0)
    weights[0] = 1.0
    if count % 2 == 0:
        weights[-1] = 1.0
    return weights


def independent_share(part: NoiseProcess) -> float:
    """Expected share of independent samples, as `mofit.data.signals.effective_samples` counts them."""
    spectrum = part.spectrum[1:]
    # the square of an exponentially distributed bin is twice its mean's square on average
    return float(min(1.0, 2 * spectrum.sum() ** 2 / (spectrum**2).sum() / part.count))
