"""Shares with their intervals, and quantiles: what the scorer's figures are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta


def upper_bound(hits: int, count: int, level: float = 0.95) -> float:
    """Clopper-Pearson bound that the true share exceeds with probability 1 - level."""
    return 1.0 if hits >= count else float(beta.ppf(level, hits + 1, count - hits))


def interval(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson interval of a share."""
    tail = (1 - level) / 2
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    return low, upper_bound(hits, count, 1 - tail)


def share(flags: Iterable[bool]) -> dict[str, Any]:
    """Hits, count, share, and its 95 % interval."""
    values = [bool(flag) for flag in flags]
    hits, count = sum(values), len(values)
    if not count:
        return {"hits": 0, "count": 0, "share": None, "low": None, "high": None}
    low, high = interval(hits, count)
    return {"hits": hits, "count": count, "share": hits / count, "low": low, "high": high}


def mean(values: Sequence[float]) -> float | None:
    """Mean value; None of nothing."""
    return float(np.mean(values)) if len(values) else None


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Count, median, 90 % quantile and largest."""
    if not len(values):
        return {"count": 0, "median": None, "p90": None, "max": None}
    return {
        "count": len(values),
        "median": float(np.median(values)),
        "p90": float(np.quantile(values, 0.9)),
        "max": float(np.max(values)),
    }
