"""The posterior of all modes together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.parameters import Array
from mofit.sample.draws import Draws
from mofit.sample.ensemble import LogPosterior


@dataclass(frozen=True)
class Mixture:
    """Draws of several modes, each with its share of the mode's weight.

    Parameters
    ----------
    points
        Draws of all modes, shape (n, d).
    weights
        Of each draw, shape (n,), of sum 1.
    mode
        Which mode each draw belongs to, shape (n,).
    """

    points: Array
    weights: Array
    mode: NDArray[np.int64]

    def mean(self) -> Array:
        """Posterior mean, shape (d,)."""
        return self.weights @ self.points

    def sd(self) -> Array:
        """Posterior standard deviation, shape (d,)."""
        return np.asarray(np.sqrt(self.weights @ (self.points - self.mean()) ** 2))

    def quantiles(self, probabilities: ArrayLike) -> Array:
        """Quantiles per parameter, shape (probability, d): of the weighted distribution, linear between draws."""
        wanted = np.asarray(probabilities, dtype=float)
        columns = []
        for values in self.points.T:
            order = np.argsort(values, kind="stable")
            weight = self.weights[order]
            columns.append(np.interp(wanted, np.cumsum(weight) - weight / 2, values[order]))
        return np.stack(columns, axis=-1)

    def draw(self, rng: np.random.Generator, count: int) -> tuple[Array, NDArray[np.int64]]:
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


def cell(number: int, values: ArrayLike, centres: Array, covariances: Array) -> Callable[[Array], NDArray[np.bool_]]:
    r"""The part of space that belongs to one of several modes.

    .. math:: \arg\min_k \; f_k + \tfrac12 (u - c_k)^T C_k^{-1} (u - c_k) = \mathrm{number}

    Every point belongs to the mode whose quadratic model predicts the highest density there. The cells fill space
    without overlap, so that the masses of the modes in their cells add up to the whole, and no walker can go over to
    another known mode.

    Parameters
    ----------
    number
        Index of the mode.
    values, centres, covariances
        Of all modes: negative log posterior f (K,), minimum c (K, d), Laplace covariance C (K, d, d).
    """
    heights, precisions = np.asarray(values, dtype=float), np.linalg.inv(covariances)

    def belongs(points: Array) -> NDArray[np.bool_]:
        gaps = points[:, None] - centres
        predicted = heights + 0.5 * np.einsum("nki,kij,nkj->nk", gaps, precisions, gaps)
        return np.asarray(np.argmin(predicted, axis=1) == number)

    return belongs


def restricted(log_posterior: LogPosterior, belongs: Callable[[Array], NDArray[np.bool_]]) -> LogPosterior:
    """The log posterior, -inf outside a cell (where it is not asked)."""

    def within(points: Array) -> Array:
        values = np.full(len(points), -np.inf)
        mine = belongs(points)
        if mine.any():
            values[mine] = log_posterior(points[mine])
        return values

    return within
