"""What a peer is, which of the points it reports are minima, and what an evaluation of its own simulator costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.pipelines.job import Evaluate, Recorded, Task
from mofit._typing import FloatArray
from mofit.identification.settings import Settings
from mofit.optimize import RefineSettings, merge, refine

#: Log posteriors after which a sampler that has not reached its target gives up.
MOST = 1_000_000
#: Where chains start and how wide they step at first, in box widths: a thousandth, which is small but not yet known to
#: be wrong in any direction.
FIRST_STEP = 1e-3


@dataclass(frozen=True)
class Peer:
    """One way to do the whole job.

    Parameters
    ----------
    name
        For the table.
    note
        How it was run.
    search
        ``(evaluate, dimension, seed)`` to the points (n, d) it reports as minima, best first.
    sample
        ``(evaluate, start, seed, target)`` to the least effective number of draws of a parameter.
    own
        Its own simulator.
    gradients
        Whether it evaluates negative log posterior and gradient of batches, not the log posterior alone.
    """

    name: str
    note: str
    search: Callable[[Evaluate, int, int], FloatArray]
    sample: Callable[[Evaluate, FloatArray, int, float], float]
    own: Callable[[Task], Evaluate]
    gradients: bool = False


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """For libraries that draw from NumPy's global generator; it is as before afterwards."""
    former = np.random.get_state()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(former)  # noqa: NPY002


#: A point so far (nats) above the best minimum is none: mofit leaves modes of less weight out as well.
FOUND = float(-np.log(Settings.least_probability))


class Known(Protocol):
    """A log posterior with derivatives."""

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Shape (N,)."""
        ...

    @property
    def evaluate(self) -> Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]:
        """Negative log posterior (N,), its gradient (N, d) and Hessian (N, d, d)."""
        ...


def distinct_minima(ends: FloatArray, known: Known, best: float) -> FloatArray:
    """Of the ends (n, d), those about as good as the best minimum, and of those between which no hill lies the best.

    The rule is `mofit.optimize.merge`, applied to the ends as they are.
    """

    def cost(u: FloatArray) -> FloatArray:
        return -known.log_posterior(u)

    good = ends[cost(ends) <= best + FOUND]
    if not len(good):
        return good
    as_they_are = refine(known.evaluate, good, RefineSettings(max_iterations=0))
    return np.array([minimum.point for minimum in merge(as_they_are, values=cost)])


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
    pairs: list[FloatArray] = []
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
