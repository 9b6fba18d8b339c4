"""A simulator that an emulator answers for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.evaluation.emulator import Emulator
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.simulator import Simulator
from mofit.simulation.step_selection import Box


class EmulatedSimulator(Simulator):
    """As `Simulator`, for parameter sets around the point of an emulator; scoped parameters are fitted in it already.

    Parameters
    ----------
    system, experiments, free
        As for `Simulator`.
    emulator
        What answers.
    absorbed
        Number of scoped values that are fitted along.
    """

    def __init__(
        self,
        system: System,
        experiments: Sequence[ExperimentData],
        free: Sequence[str],
        emulator: Emulator,
        absorbed: int = 0,
    ) -> None:
        super().__init__(system, experiments, free, steps=1)
        self._scheduler, self._absorbed = emulator, absorbed
        self.emulator = emulator

    def log_volume(self, p: FloatArray) -> FloatArray:
        """What integrating over scoped parameters adds to a negative log likelihood at sets (N, np), (N,)."""
        return self.emulator.log_volume(p)

    @property
    def absorbed(self) -> int:
        """Number of values of scoped parameters that are fitted along."""
        return self._absorbed

    def within(self, box: Box, tolerance: float | None = None) -> Simulator:
        """Itself: it is good around its point."""
        return self

    def with_steps(self, steps: int) -> Simulator:
        """Itself: there is nothing to integrate."""
        return self

    def _choices(self, p: FloatArray) -> list[Any]:
        """None: there is nothing to integrate."""
        return []
