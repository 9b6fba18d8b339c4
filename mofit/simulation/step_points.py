"""The steps of a test and the inputs at their nodes: the same for all models that switch at the same times."""

from __future__ import annotations

from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.table_cache import TableCache
from mofit.simulation.time_grid import StepLevel, build_time_grid, find_switches

#: steps up to which the inputs are kept: those of long records take several times the memory of the samples
_MOST_STEPS = 50_000


class StepPoints:
    """The steps of a test in order of time, (n,), and the inputs at their nodes.

    Attributes
    ----------
    start, length
        Of every step, s.
    counts
        Steps of every sampling interval.
    begins
        Which steps begin a sampling interval.
    first
        The first sample of the inputs, (nu,).
    """

    def __init__(self, experiment: ExperimentData, level: StepLevel, switches: tuple[FloatArray, FloatArray]) -> None:
        # before the grid is there: making the curve of the inputs takes several times its memory
        self.first = experiment.at(np.zeros(1))[:, 0]
        grid = build_time_grid(experiment, level, switches)
        self.start, self.length, self.counts = grid.start, grid.end - grid.start, grid.counts
        self._end, self._nodes = grid.end, level.scheme.nodes
        self.begins = np.zeros(len(grid.start), dtype=bool)
        self.begins[np.cumsum(grid.counts) - grid.counts] = True
        #: Inputs at the nodes of all steps, (nodes * nu, n); None where they would fill the memory.
        self.inputs: FloatArray | None = None
        if len(self.start) <= _MOST_STEPS:
            self.inputs = self.inputs_of(experiment, slice(None))

    @property
    def nbytes(self) -> int:
        """Bytes that it takes."""
        arrays = (self.start, self.length, self._end, self.counts, self.begins)
        return sum(array.nbytes for array in arrays) + (0 if self.inputs is None else self.inputs.nbytes)

    @cached_property
    def evenly(self) -> bool:
        """Whether every sampling interval is one step."""
        return bool(self.begins.all())

    def inputs_of(self, experiment: ExperimentData, steps: slice | NDArray[np.intp]) -> FloatArray:
        """Inputs of the test at the nodes of some steps, one node after the other, (nodes * nu, steps)."""
        if self.inputs is not None:
            return self.inputs[:, steps]
        start, length, end = self.start[steps], self.length[steps], self._end[steps]
        at = [end if node == 1 else start + node * length for node in self._nodes]
        return np.concatenate([experiment.during(start, time) for time in at])


def step_points(system: System, experiment: ExperimentData, level: StepLevel) -> StepPoints:
    """The steps of a test as a system and a step level cut them; those of a short test are kept while there is room."""
    switches = find_switches(system, experiment.origin or experiment)
    if experiment.samples * level.steps > _MOST_STEPS:
        return StepPoints(experiment, level, switches)
    cache = _points.setdefault(experiment, TableCache())
    # systems of other switches, which few have, share them, too
    name = (level, *(times.tobytes() for times in switches))
    return cache.table(name, lambda: StepPoints(experiment, level, switches), {name})


#: by test, with which they go
_points: WeakKeyDictionary[ExperimentData, TableCache[StepPoints]] = WeakKeyDictionary()
