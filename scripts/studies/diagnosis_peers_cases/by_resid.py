"""Residual tests alone: whiteness, and independence of the input, as MATLAB's ``resid`` draws them."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from diagnosis_peers_cases.answer import Answer
from diagnosis_peers_cases.records import Records
from mofit._typing import FloatArray

LAGS, LEVEL = 25, 0.99


def whiteness(records: Records, held: Records) -> Answer:
    """A gap where an autocorrelation of the residual leaves the band."""
    found = np.stack([_correlation(e, e)[1:] for e in _centred(records.residual)])
    return Answer(bool(np.any(np.abs(found) > _quantile(found) / np.sqrt(records.residual.shape[1]))))


def independence(records: Records, held: Records) -> Answer:
    """A gap where a correlation of past input and residual leaves the band, which knows that both are coloured."""
    residual, input_ = _centred(records.residual), _centred(records.input)
    outside = []
    for e, u in zip(residual, input_, strict=True):
        count = len(e)
        colour = _correlation(e, e, count // 4), _correlation(u, u, count // 4)
        variance = 1 + 2 * float(np.sum(colour[0][1:] * colour[1][1:]))  # of sqrt(n) times the correlation
        band = _quantile(np.empty((len(residual), LAGS + 1))) * np.sqrt(max(variance, 1e-3) / count)
        outside.append(np.abs(_correlation(e, u)) > band)
    lags = np.flatnonzero(np.any(outside, axis=0))
    return Answer(bool(len(lags)), where=f"lags {lags.min()} to {lags.max()}" if len(lags) else "")


def _centred(signal: FloatArray) -> FloatArray:
    return np.asarray(signal - signal.mean(axis=1, keepdims=True))


def _correlation(e: FloatArray, u: FloatArray, lags: int = LAGS) -> FloatArray:
    """Of e with u, lags 0 to ``lags`` earlier."""
    size = np.linalg.norm(e) * np.linalg.norm(u) or 1.0
    return np.array([e[lag:] @ u[: len(u) - lag] for lag in range(lags + 1)]) / size


def _quantile(found: FloatArray) -> float:
    """Of the largest of all tests and lags (Bonferroni)."""
    return float(norm.isf((1 - LEVEL) / 2 / found.size))
