"""What a peer is: a search and a sampler as its users would write them, and a simulator of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.bench.pipelines.fast import Evaluate
from mofit.bench.pipelines.task import Task

Array = NDArray[np.float64]

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
    search: Callable[[Evaluate, int, int], Array]
    sample: Callable[[Evaluate, Array, int, float], float]
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
