"""Shares of the gap that an effect removes, from squares of errors at draws of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray


@dataclass(frozen=True)
class Squares:
    """Mean squares of the errors on a hold-out without and with the effect: per draw of the parameters and part.

    Shapes (draws, parts); parts are tests, or blocks of time of a record. What the noise may hide of them, ``hidden``,
    adds to both; all parts together hide no less than nothing.
    """

    before: FloatArray
    after: FloatArray
    hidden: FloatArray

    def resampled(self, random: np.random.Generator) -> FloatArray:
        """Share removed in every draw, its parts drawn with replacement (bootstrap), (draws,)."""
        draws, parts = self.before.shape
        times = random.multinomial(parts, np.full(parts, 1 / parts), draws)
        return self._removed(times.astype(np.float64))

    @property
    def share(self) -> float:
        """Median over the draws of the share removed in all parts."""
        return float(np.median(self._removed(np.ones(self.before.shape[1]))))

    def _removed(self, times: FloatArray) -> FloatArray:
        sums = [np.sum(times * one, axis=1) for one in (self.before, self.after, self.hidden)]
        before, after, hidden = (np.maximum(one, 0.0) for one in sums)
        clear = sums[0] > 0  # less noise, it may be negative
        return np.asarray(1 - ((after + hidden) / np.where(clear, before + hidden, 1.0))[clear])


def joined(squares: Sequence[Squares]) -> Squares:
    """Several hold-outs as one."""
    return Squares(
        *(np.concatenate([getattr(one, key) for one in squares], axis=1) for key in ("before", "after", "hidden"))
    )


def interval(shares: Sequence[FloatArray], middle: float) -> tuple[float, float]:
    """5 % and 95 % quantile of shares drawn from several hold-outs, each as probable; the middle is inside."""
    low, high = np.quantile(np.concatenate(shares), (0.05, 0.95))
    return min(float(low), middle), max(float(high), middle)
