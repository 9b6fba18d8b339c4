"""Simulators of the diagnosis: compiled once, integrated finely enough, divergence detected."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import Model, System, build_system
from mofit.runtime.parallel import threads
from mofit.simulation import ExperimentData, Simulator

#: Where a divergent integration ends: no output or derivative is as large.
DIVERGED = 1e100
#: Whitened observations and derivatives as large as this come from an unstable integration, too.
_UNSTABLE = 1e20
#: Most Runge–Kutta steps per sampling interval: what is stiffer (a sharp dry friction) takes too long to fit.
MOST_STEPS = 16
#: In slowly sampled records more steps keep fast states of an effect stable.
_MOST_STEPS_TO_STABILISE = 64


class SimulatorCache:
    """Builds simulators, and compiles each model once for all hypotheses and campaigns.

    Parameters
    ----------
    jobs
        Threads, or processes of one thread; results do not depend on it.
    """

    def __init__(self, jobs: int = 1) -> None:
        self.jobs = jobs
        self._compiled: dict[tuple[str, tuple[str, ...]], Simulator] = {}

    def simulator(
        self, model: Model, experiments: Sequence[ExperimentData], free: Sequence[str], steps: int = 1
    ) -> tuple[System, Simulator]:
        """The model as a system, and its simulator on these tests with a fixed number of Runge–Kutta steps."""
        system = build_system(model)
        key = (system.hash(), tuple(free))
        if key not in self._compiled:
            # most are called once or twice: tables would not pay
            jobs = threads(self.jobs)
            self._compiled[key] = Simulator(system, experiments, free, jobs=jobs, steps=steps, fixed_per_lane=True)
        return system, self._compiled[key].without_tables().with_steps(steps).with_experiments(experiments)


def stable(values: FloatArray, axis: tuple[int, ...] | None = None) -> NDArray[np.bool_]:
    """Whether no value, of all or along some axes, comes from an unstable integration."""
    return within(values, _UNSTABLE, axis)


def within(values: FloatArray, limit: float, axis: tuple[int, ...] | None = None) -> NDArray[np.bool_]:
    """Whether all values, or those along some axes, are below a limit in size; nan is not."""
    highest, lowest = np.max(values, axis=axis, initial=0.0), np.min(values, axis=axis, initial=0.0)
    return np.asarray((highest < limit) & (lowest > -limit))


def clipped(values: FloatArray) -> FloatArray:
    """Values kept finite where the integration diverged."""
    return np.clip(np.nan_to_num(values, nan=DIVERGED), -DIVERGED, DIVERGED)


def with_enough_steps(
    simulator: Simulator,
    rows: Callable[[Simulator], FloatArray],
    change: Callable[[FloatArray, FloatArray], float],
    allowed: float,
    fewest: int = 1,
) -> tuple[Simulator, FloatArray]:
    """Double the steps until that no longer changes the result.

    Parameters
    ----------
    simulator
        Of a model and its tests.
    rows
        What is computed with it.
    change
        Difference between two such results, with few and with twice as many steps.
    allowed
        Largest difference.
    fewest
        The first number of steps tried.

    Returns
    -------
    The simulator with the fewest sufficient steps, and its result.
    """
    steps, found = each_with_enough_steps(
        lambda steps, _: rows(simulator.with_steps(steps))[None], change, allowed, 1, fewest
    )
    return simulator.with_steps(int(steps[0])), found[0]


def each_with_enough_steps(
    rows: Callable[[int, NDArray[np.intp]], FloatArray],
    change: Callable[[FloatArray, FloatArray], float],
    allowed: float,
    count: int,
    fewest: int = 1,
) -> tuple[NDArray[np.int64], FloatArray]:
    """Double the steps of every one of ``count`` parameter sets until that no longer changes its result.

    Parameters
    ----------
    rows
        Results (k, ...) with so many steps of those k sets that have these indices.
    change, allowed, fewest
        As in `with_enough_steps`, of one set.

    Returns
    -------
    The fewest sufficient steps of every set (count,), and the results with them (count, ...).
    """
    waiting, steps = np.arange(count), fewest
    taken, found, coarse = np.zeros(count, dtype=np.int64), {}, None
    while len(waiting):
        # the finer one first: the loop compiled for it serves the coarser one too
        fine = rows(2 * steps, waiting)
        coarse = rows(steps, waiting) if coarse is None else coarse
        further = np.zeros(len(waiting), dtype=bool)
        for place, (which, here, there) in enumerate(zip(waiting, coarse, fine, strict=True)):
            # two divergent integrations agree as well
            enough = stable(here) and change(here, there) <= allowed
            taken[which], found[which] = (steps, here) if enough else (2 * steps, there)
            further[place] = not enough and 4 * steps <= (MOST_STEPS if stable(there) else _MOST_STEPS_TO_STABILISE)
        waiting, coarse, steps = waiting[further], fine[further], 2 * steps
    return taken, np.stack([found[which] for which in np.arange(count)])
