"""What an evaluation of a peer's own simulator costs, and whether it computes the same thing."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.bench.pipelines.fast import Evaluate, Recorded

Array = NDArray[np.float64]

#: Points so far (nats) below the best are visited while a chain warms up, not in a sample of ten parameters.
REACH = 20.0


@dataclass(frozen=True)
class Price:
    """Of one evaluation.

    Parameters
    ----------
    seconds
        Mean time.
    deviation
        How far the two simulators disagree on differences of the log posterior, at most, in nats, where it is within
        `REACH` of the best.
    points
        How many it was measured at.
    """

    seconds: float
    deviation: float
    points: int


def price(own: Evaluate, visited: Recorded, batches: bool, limit: float, seed: int) -> Price:
    """Evaluate points drawn from those visited, without replacement, until so many seconds are spent.

    Parameters
    ----------
    own
        The peer's simulator.
    visited
        What was evaluated in its place.
    batches
        Whether it takes the points in batches, as they came, rather than one by one; results are pairs then.
    limit
        At least one point is evaluated.
    seed
        Of the draw.
    """
    pool = visited.batches if batches else list(np.concatenate(visited.batches)[:, None, :])
    for size in sorted({len(batch) for batch in pool}) if batches else ():
        own(np.full((size, pool[0].shape[1]), 0.5))  # compiled for every size before the clock runs
    spent, points = 0.0, 0
    pairs: list[Array] = []
    for index in np.random.default_rng(seed).permutation(len(pool)):
        begin = time.perf_counter()
        found = own(pool[index])
        spent += time.perf_counter() - begin
        points += len(pool[index])
        reference = visited.function(pool[index])
        pairs.append(np.array([-found[0], -reference[0]] if batches else [found, reference]))
        if spent > limit:
            break
    theirs, ours = np.concatenate(pairs, axis=1)
    near = ours >= ours.max() - REACH
    return Price(spent / points, float(np.ptp(theirs[near] - ours[near])), points)
