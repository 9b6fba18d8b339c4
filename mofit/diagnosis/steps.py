"""How finely to integrate: steps that change nothing when they are halved, and what has run away."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mofit.kernel import Simulator

Array = NDArray[np.float64]

#: Fewest and most Runge-Kutta steps per sampling interval: what is stiffer, a dry friction, takes too long to fit. In
#: slow records more of them keep fast states of an effect stable.
FEWEST_STEPS, _MOST_STEPS, _MOST_TO_BE_STABLE = 1, 16, 64
#: Where an unstable integration has gone: no output or derivative is as large.
RUNAWAY = 1e100
#: White rows and slopes this large come from an unstable integration, too.
_WILD = 1e20


def bounded(values: Array) -> bool:
    """Whether no value comes from an unstable integration."""
    return bool((np.abs(values) < _WILD).all())


def tamed(values: Array) -> Array:
    """Values with what an unstable integration has made of them kept finite."""
    return np.clip(np.nan_to_num(values, nan=RUNAWAY), -RUNAWAY, RUNAWAY)


def with_enough_steps(
    simulator: Simulator,
    rows: Callable[[Simulator], Array],
    change: Callable[[Array, Array], float],
    allowed: float,
    fewest: int = FEWEST_STEPS,
) -> tuple[Simulator, Array]:
    """The simulator with the fewest steps whose halving changes rows by no more than allowed, and its rows."""
    steps, coarse = fewest, None
    while coarse is None or 2 * steps <= (_MOST_STEPS if bounded(coarse) else _MOST_TO_BE_STABLE):
        # the finer one first: the loop that is compiled for it serves the coarser one too
        fine = rows(simulator.with_steps(2 * steps))
        here = simulator.with_steps(steps)
        coarse = rows(here) if coarse is None else coarse
        # two integrations that ran away are alike as well
        if bounded(coarse) and change(coarse, fine) <= allowed:
            return here, coarse
        steps, coarse = 2 * steps, fine
    return simulator.with_steps(steps), coarse
