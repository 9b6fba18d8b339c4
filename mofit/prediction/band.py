"""The 90 % band of a record, and how well it holds where the output was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mofit._typing import FloatArray

#: Quantiles of a band, and that of a Gaussian for the upper one.
LOW, HIGH = 0.05, 0.95
#: Halvings of the bracket of a quantile, which is the range of the draws: to 1e-6 of it.
_HALVINGS = 20
#: Numbers that are worked on at once.
_AT_ONCE = 2_000_000


@dataclass(frozen=True)
class Band:
    """An output of a record (n,): median, 90 % band by parameters alone, and of a new measurement; in its unit."""

    median: FloatArray
    parameter_low: FloatArray
    parameter_high: FloatArray
    low: FloatArray
    high: FloatArray
    parameter_sd: float
    """Spread over the draws: root mean square over the samples of its standard deviation."""


@dataclass(frozen=True)
class Score:
    """How well a band holds; nan where nothing was measured."""

    nrmsd: float
    rms: float
    coverage: float
    """Share of the samples within the band."""


def band(draws: FloatArray, sd: float) -> Band:
    """The band of an output at draws (D, n), with noise and model error of this standard deviation together."""
    inner = np.quantile(draws, [LOW, 0.5, HIGH], axis=0)
    spread = float(np.sqrt(np.mean(np.var(draws, axis=0))))
    low, high = (mixture_quantile(draws, sd, share) for share in (LOW, HIGH))
    return Band(inner[1], inner[0], inner[2], low, high, spread)


def mixture_quantile(centres: FloatArray, sd: float, share: float) -> FloatArray:
    r"""Quantile of an equal mixture of Gaussians around centres (D, n), per column, (n,).

    .. math:: \frac1D \sum_k \Phi\!\left(\frac{q - y_k}{\sigma}\right) = p

    It lies between those of the least and of the largest centre, where it is found by halving. Without a standard
    deviation it is that of the centres.
    """
    if not sd > 0:
        return np.asarray(np.quantile(centres, share, axis=0))
    width = max(1, _AT_ONCE // len(centres))
    parts = [_halved(centres[:, k : k + width], sd, share) for k in range(0, centres.shape[1], width)]
    return np.concatenate(parts)


def _halved(centres: FloatArray, sd: float, share: float) -> FloatArray:
    own = sd * float(ndtri(share))
    low, high = centres.min(axis=0) + own, centres.max(axis=0) + own
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = ndtr((middle - centres) / sd).mean(axis=0) < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def score(found: Band, measured: FloatArray, used: NDArray[np.bool_]) -> Score:
    """Of a band, by the measured output (n,) at the samples that count."""
    if not used.any():
        return Score(np.nan, np.nan, np.nan)
    rms = float(np.sqrt(np.mean((measured - found.median)[used] ** 2)))
    inside = (measured >= found.low) & (measured <= found.high)
    return Score(rms / float(np.ptp(measured)), rms, float(np.mean(inside[used])))
