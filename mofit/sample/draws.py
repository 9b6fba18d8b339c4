"""From correlated steps of walkers to nearly independent draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array


@dataclass(frozen=True)
class Draws:
    """Nearly independent draws; `chain` counts ensembles.

    Parameters
    ----------
    points
        Shape (chain, draw, d).
    log_prob
        Log posterior, shape (chain, draw).
    walker, step
        Where each draw comes from, shape (chain, draw).
    """

    points: Array
    log_prob: Array
    walker: NDArray[np.int64]
    step: NDArray[np.int64]


def thin(chain: Array, log_prob: Array, home: NDArray[np.bool_], every: int, first: int = 0) -> Draws:
    """Every `every`-th step of each ensemble, the walkers side by side.

    Parameters
    ----------
    chain, log_prob
        Shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    home
        Walkers to use, shape (ensemble, walker); of each ensemble as many as the smallest has.
    every
        Steps from draw to draw: the autocorrelation time makes them nearly independent.
    first
        Steps left out at the beginning.

    Returns
    -------
    Draws in the order of the steps, so that a split of the draws is a split in time.
    """
    steps = np.arange(first + every - 1, chain.shape[1], every)
    count = int(home.sum(axis=1).min())
    walkers = np.stack([np.flatnonzero(row)[:count] for row in home])
    picked = np.arange(len(chain))[:, None, None], steps[None, :, None], walkers[:, None, :]
    shape = (len(chain), len(steps) * count)
    return Draws(
        points=chain[picked].reshape(*shape, chain.shape[3]),
        log_prob=log_prob[picked].reshape(shape),
        walker=np.broadcast_to(picked[2], (len(chain), len(steps), count)).reshape(shape),
        step=np.broadcast_to(picked[1], (len(chain), len(steps), count)).reshape(shape),
    )
