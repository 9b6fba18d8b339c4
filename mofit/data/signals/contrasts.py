r"""The lines of a residual that a fit has not touched: what restricted maximum likelihood takes for the noise.

Of a residual r with lines of variance S, and of signals B (real and imaginary parts of the known lines) whose
coefficients were fitted, the restricted likelihood is

.. math:: -2 \log L = \sum_k \log S_k + |r_k - B_k \hat c|^2 / S_k + \log \det G, \quad
          G = B^\top S^{-1} B, \quad \hat c = G^{-1} B^\top S^{-1} r

It is the same for every estimate of the coefficients that the residual was taken beside.

References
----------
Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data.signals.thin_svd import thin_svd

_TINY = np.finfo(float).tiny
#: Relative singular value below which a combination of fitted signals has no power on the known lines.
_RANK = 1e-6


class BesideFitted(NamedTuple):
    """A residual beside fitted signals, on the bins, for a spectrum."""

    power: FloatArray
    """What generalised least squares leave, (bins,)."""
    absorbed: FloatArray
    """What they are expected to take from the noise, (bins,)."""
    log_information: float
    """Log determinant of G."""


@dataclass(frozen=True)
class Contrasts:
    """Lines of a residual (2, bins), real and imaginary part; which are known; fitted signals there (2 bins, q)."""

    lines: FloatArray
    known: NDArray[np.bool_]
    basis: FloatArray

    @classmethod
    def of(cls, lines: NDArray[Any], known: NDArray[np.bool_], fitted: NDArray[Any] | None) -> Contrasts:
        """From complex lines (bins,), and those of the fitted signals (bins, d), which may depend on each other."""
        parts = np.stack([np.real(lines), np.imag(lines)])
        if fitted is None:
            return cls(parts, known, np.zeros((2 * len(known), 0)))
        size = np.linalg.norm(fitted, axis=0)
        signals = fitted[:, size > 0] / size[size > 0] * known[:, None]
        rows = np.concatenate([signals.real, signals.imag])
        vectors, values, _ = thin_svd(rows)
        return cls(parts, known, np.ascontiguousarray(vectors[:, values > _RANK]))

    def beside_fitted(self, spectrum: FloatArray) -> BesideFitted:
        """By generalised least squares for a spectrum (bins,)."""
        if self.basis.shape[1] == 0:
            return BesideFitted(np.sum(self.lines**2, axis=0), np.zeros(len(spectrum)), 0.0)
        # a line of variance S has half of it in each part
        scaled = self.basis / np.tile(0.5 * spectrum, 2)[:, None]
        information = self.basis.T @ scaled
        inverse = np.linalg.inv(information)
        rest = self.lines - (self.basis @ (inverse @ (self.lines.ravel() @ scaled))).reshape(self.lines.shape)
        absorbed = np.sum(((self.basis @ inverse) * self.basis).reshape(2, len(spectrum), -1), axis=(0, 2))
        return BesideFitted(np.sum(rest**2, axis=0), absorbed, float(np.linalg.slogdet(information)[1]))

    def scaled(self, shape: FloatArray) -> FloatArray:
        """A spectrum of this shape (bins,) at its most likely level."""
        squares = float(np.sum((self.beside_fitted(shape).power / shape)[self.known]))
        return np.maximum(shape * squares / max(float(self.known.sum()) - 0.5 * self.basis.shape[1], 0.5), _TINY)
