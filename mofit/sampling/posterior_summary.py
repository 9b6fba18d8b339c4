"""The posterior of all modes together, and the classification of each parameter by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.sampling.chains import Draws

#: A posterior whose median is nearer to a bound than so many of its standard deviations on that side (median to 16 %
#: or 84 % quantile) reaches the bound: zero, say, is then as good as the estimate.
REACHES = 2.0
#: Contractions (1 - posterior sd / prior sd) below which a parameter is not identifiable, and weakly identified.
UNMOVED = 0.1
WEAK = 0.5
#: Standard deviation of a logarithm above which a parameter is weakly identified, however wide its range was: 90 % of
#: the posterior spans a factor of five.
WIDE = 0.5


@dataclass(frozen=True)
class Mixture:
    """Draws of several modes, each with its share of the mode's weight."""

    points: FloatArray  # (n, d)
    weights: FloatArray  # of sum 1, (n,)
    mode: NDArray[np.int64]  # which one each draw belongs to, (n,)

    def mean(self) -> FloatArray:
        """Posterior mean, shape (d,)."""
        return self.weights @ self.points

    def sd(self) -> FloatArray:
        """Posterior standard deviation, shape (d,)."""
        return np.asarray(np.sqrt(self.weights @ (self.points - self.mean()) ** 2))

    def quantiles(self, probabilities: ArrayLike) -> FloatArray:
        """Quantiles per parameter, shape (probability, d): of the weighted distribution, linear between draws."""
        wanted = np.asarray(probabilities, dtype=float)
        columns = []
        for values in self.points.T:
            order = np.argsort(values, kind="stable")
            weight = self.weights[order]
            columns.append(np.interp(wanted, np.cumsum(weight) - weight / 2, values[order]))
        return np.stack(columns, axis=-1)

    def draw(self, rng: np.random.Generator, count: int) -> tuple[FloatArray, NDArray[np.int64]]:
        """Draws in proportion to the weights: points (count, d) and their modes (count,)."""
        picked = rng.choice(len(self.points), size=count, p=self.weights)
        return self.points[picked], self.mode[picked]


def mixture(draws: Sequence[Draws], weights: ArrayLike) -> Mixture:
    """Join the draws of modes whose weights (mode,) are known, see `mode_weights`."""
    parts = [part.points.reshape(-1, part.points.shape[2]) for part in draws]
    shares = np.asarray(weights, dtype=float) / np.sum(weights)
    return Mixture(
        points=np.concatenate(parts),
        weights=np.concatenate([np.full(len(p), w / len(p)) for p, w in zip(parts, shares, strict=True)]),
        mode=np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
    )


def contraction(samples: FloatArray) -> FloatArray:
    """1 - posterior sd / prior sd per parameter, for samples (n, d) in the unit cube (uniform prior)."""
    return 1.0 - samples.std(axis=0) * np.sqrt(12.0)


def verdict(samples: FloatArray, log_width: ArrayLike = 0.0) -> list[str]:
    """One verdict per parameter from posterior samples (n, d) in the unit cube.

    ``identified``; ``weakly identified``; ``lower limit only`` (it reaches the upper bound); ``upper limit only`` (the
    lower one); ``not identifiable`` (as wide as the prior). A bound is near or far in units of the posterior's own
    spread: how wide the prior is does not matter to it.

    Parameters
    ----------
    samples
        Shape (n, d).
    log_width
        Width of the range in natural logarithm, of parameters on a log scale; 0 for the others; shape (d,).
    """
    words = []
    widths = np.broadcast_to(np.asarray(log_width, dtype=float), samples.shape[1:])
    for column, learnt, width in zip(samples.T, contraction(samples), widths, strict=True):
        below, median, above = np.quantile(column, [0.1587, 0.5, 0.8413])
        low = median < REACHES * (median - below)
        high = 1 - median < REACHES * (above - median)
        if learnt < UNMOVED or (low and high):
            words.append("not identifiable")
        elif high:
            words.append("lower limit only")
        elif low:
            words.append("upper limit only")
        else:
            sure = learnt >= WEAK and column.std() * width <= WIDE
            words.append("identified" if sure else "weakly identified")
    return words
