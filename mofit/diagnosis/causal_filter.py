r"""The causal filter that whitens a noise of known spectrum.

.. math:: 1 / \sqrt{S(\omega)} = |H(\omega)|, \quad H(\omega) = \sum_{k \ge 0} h_k e^{-i \omega k}

References
----------
Oppenheim and Schafer, "Discrete-Time Signal Processing" (2010), ch. 13: minimum phase from the cepstrum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.linalg import toeplitz

from mofit._typing import FloatArray

#: Samples at the start whose noise the filter, without their past, leaves too large.
_START = 64


@dataclass(frozen=True)
class CausalFilter:
    """A filter of n coefficients, its inverse, and the weights (n,) that give noise of variance 1 from the start."""

    forward: FloatArray
    backward: FloatArray
    weights: FloatArray

    @classmethod
    def whitening(cls, spectrum: FloatArray, count: int) -> CausalFilter:
        """Of a spectrum on the bins of the real FFT (n // 2 + 1,); the past of a record counts as zero."""
        forward = _minimum_phase(-0.5 * np.log(spectrum), count)
        start = min(_START, count)
        past = np.tril(toeplitz(forward[:start]))
        covariance = toeplitz(fft.irfft(spectrum, count)[:start])
        weights = np.ones(count)
        weights[:start] = 1 / np.sqrt(np.einsum("ij,jk,ik->i", past, covariance, past))
        return cls(forward, _minimum_phase(0.5 * np.log(spectrum), count), weights)

    def apply(self, values: FloatArray) -> FloatArray:
        """White signals of signals (..., n)."""
        return _convolved(values, self.forward) * self.weights

    def undo(self, values: FloatArray) -> FloatArray:
        """The inverse of `apply`."""
        return _convolved(values / self.weights, self.backward)


def _minimum_phase(logarithm: FloatArray, count: int) -> FloatArray:
    """Impulse response (n,) of minimum phase, from the logarithm of its amplitude."""
    cepstrum = fft.irfft(logarithm, count)
    cepstrum[1 : (count + 1) // 2] *= 2
    cepstrum[count // 2 + 1 :] = 0.0
    return np.asarray(fft.irfft(np.exp(fft.rfft(cepstrum)), count))


def _convolved(values: FloatArray, response: FloatArray) -> FloatArray:
    """The first n samples of a convolution."""
    count = len(response)
    length = fft.next_fast_len(2 * count, real=True)
    return np.asarray(fft.irfft(fft.rfft(values, length) * fft.rfft(response, length), length)[..., :count])
