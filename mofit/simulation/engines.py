"""What runs a system's parameter sets through tests: compiled loops for equations, calls for a user's simulator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from mofit._typing import FloatArray
from mofit.models import BlackBoxSystem, System
from mofit.simulation.evaluation.engine import FILTER_STEPS, BlackBoxEngine
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.scheduler import Scheduler
from mofit.simulation.time_grid import StepChoice


class Engine(Protocol):
    """Runs parameter sets (N, np), or (N, T, np) where each test has its own, through tests."""

    def without_tables(self) -> Engine:
        """The same without what only speeds up the next call."""

    def reduced(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> FloatArray:
        """Sums per set, test and output (see `mofit.simulation.compiler.loop.Shape.terms`), (N, T, ny, terms)."""

    def stored(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> list[FloatArray]:
        """Outputs and, with ``derivatives``, their slopes, (N, n, ny, 1 + nf) per test."""


def engine_for(system: System, free: Sequence[str], jobs: int, *, fixed_per_lane: bool = False) -> Engine:
    """The engine of a system; see `mofit.simulation.scheduler.Scheduler` for the parameters."""
    if isinstance(system, BlackBoxSystem):
        return BlackBoxEngine(system, free)
    return Scheduler(system, free, jobs, fixed_per_lane=fixed_per_lane)


def steps_for(system: System, steps: int | None) -> int | None:
    """The fixed number of steps per sampling interval of a system; None: they are chosen."""
    if not system.states:
        return 1  # there is nothing to integrate
    return steps or (FILTER_STEPS if isinstance(system, BlackBoxSystem) else None)
