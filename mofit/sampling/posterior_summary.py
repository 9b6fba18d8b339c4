"""The posterior of all modes together, and the classification of each parameter by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.sampling.chains import Draws

#: A posterior with more than this share of its mass within `EDGE` of a bound is truncated there.
TRUNCATED = 0.05
EDGE = 0.01
#: Contractions (1 - posterior sd / prior sd) below which a parameter is not identifiable, and weakly identified.
UNMOVED = 0.1
WEAK = 0.5


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


def verdict(samples: FloatArray) -> list[str]:
    """One verdict per parameter from posterior samples (n, d) in the unit cube.

    ``identified``; ``weakly identified``; ``lower limit only`` (truncated at the upper bound); ``upper limit only`` (at
    the lower one); ``not identifiable`` (as wide as the prior).
    """
    words = []
    for column, learnt in zip(samples.T, contraction(samples), strict=True):
        low, high = np.mean(column < EDGE) > TRUNCATED, np.mean(column > 1 - EDGE) > TRUNCATED
        if learnt < UNMOVED or (low and high):
            words.append("not identifiable")
        elif high:
            words.append("lower limit only")
        elif low:
            words.append("upper limit only")
        else:
            words.append("identified" if learnt >= WEAK else "weakly identified")
    return words
