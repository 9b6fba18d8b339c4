"""Simulators of the diagnosis: compiled once, integrated finely enough, divergence detected."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.models import Model, System, build_system
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
        Threads; results do not depend on it.
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
            self._compiled[key] = Simulator(system, experiments, free, jobs=self.jobs, steps=steps)
        return system, self._compiled[key].without_tables().with_steps(steps).with_experiments(experiments)


def stable(values: FloatArray) -> bool:
    """Whether no value comes from an unstable integration."""
    return bool((np.abs(values) < _UNSTABLE).all())


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
    steps, coarse = fewest, None
    while coarse is None or 2 * steps <= (MOST_STEPS if stable(coarse) else _MOST_STEPS_TO_STABILISE):
        # the finer one first: the loop compiled for it serves the coarser one too
        fine = rows(simulator.with_steps(2 * steps))
        here = simulator.with_steps(steps)
        coarse = rows(here) if coarse is None else coarse
        # two divergent integrations agree as well
        if stable(coarse) and change(coarse, fine) <= allowed:
            return here, coarse
        steps, coarse = 2 * steps, fine
    return simulator.with_steps(steps), coarse
