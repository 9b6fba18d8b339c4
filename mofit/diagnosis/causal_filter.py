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
#: Share down to which a level is as certain as the filter has it: the ends of a record tell more than its middle.
_ENDS = 0.8


@dataclass(frozen=True)
class CausalFilter:
    """A filter of n coefficients, its inverse, and the weights (n,) that give noise of variance 1 from the start.

    Noise with a long memory has a level that its past has left, and all white samples share what the filter, without
    that past, leaves of it. Along a ``constant`` (n,), of unit length when white, they shrink to a ``share``: a level
    is as uncertain as the spectrum at zero says.
    """

    forward: FloatArray
    backward: FloatArray
    weights: FloatArray
    constant: FloatArray
    share: float

    @classmethod
    def whitening(cls, spectrum: FloatArray, count: int) -> CausalFilter:
        """Of a spectrum on the bins of the real FFT (n // 2 + 1,); the past of a record counts as zero."""
        forward = _minimum_phase(-0.5 * np.log(spectrum), count)
        start = min(_START, count)
        past = np.tril(toeplitz(forward[:start]))
        covariance = toeplitz(fft.irfft(spectrum, count)[:start])
        weights = np.ones(count)
        weights[:start] = 1 / np.sqrt(np.einsum("ij,jk,ik->i", past, covariance, past))
        level = _convolved(np.ones(count), forward) * weights
        size = float(np.linalg.norm(level))
        share = float(np.sqrt(count / spectrum[0])) / size
        backward = _minimum_phase(0.5 * np.log(spectrum), count)
        return cls(forward, backward, weights, level / size, share if share < _ENDS else 1.0)

    def apply(self, values: FloatArray) -> FloatArray:
        """White signals of signals (..., n)."""
        return self._along_constant(_convolved(values, self.forward) * self.weights, self.share)

    def undo(self, values: FloatArray) -> FloatArray:
        """The inverse of `apply`."""
        return _convolved(self._along_constant(values, 1 / self.share) / self.weights, self.backward)

    def _along_constant(self, white: FloatArray, factor: float) -> FloatArray:
        """White signals (..., n) with what they have of a constant multiplied."""
        return np.asarray(white + (factor - 1) * (white @ self.constant)[..., None] * self.constant)


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
