"""Tests side by side, one per lane of a register: their steps in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.step_points import StepPoints, step_points
from mofit.simulation.table_cache import TableCache
from mofit.simulation.time_grid import StepLevel


@dataclass(frozen=True)
class LaneSteps:
    """Some of the steps that lanes take together, and which of their tests' own they are.

    Attributes
    ----------
    count
        Of them.
    at
        Which step of its test each is, per lane, and as the last one where a test waits at its end for the others.
    length
        Of all these, one lane after the other, s; zero where a test waits.
    """

    count: int
    at: tuple[NDArray[np.intp], ...]
    length: FloatArray

    @property
    def nbytes(self) -> int:
        """Bytes that it takes."""
        return sum(array.nbytes for array in (*self.at, self.length))

    def first(self, values: FloatArray, lanes: int) -> FloatArray:
        """The first row of `spread`, (values, lanes)."""
        starts = np.cumsum([0, *map(len, self.at[:-1])])
        return np.take(values, np.pad(starts, (0, lanes - len(starts)), mode="edge"), axis=1)

    def spread(self, values: FloatArray, lanes: int) -> FloatArray:
        """Values of all steps (values, steps of all tests) as rows (count, values, lanes).

        The last test fills the lanes that are left.
        """
        rows, before = np.empty((self.count, len(values), lanes)), 0
        for lane, at in enumerate(self.at):
            there = len(at) - 1
            where = slice(lane, lane + 1 if lane + 1 < len(self.at) else lanes)
            rows[:there, :, where] = values[:, before : before + there].T[:, :, None]
            rows[there:, :, where] = values[:, before + there, None]
            before += len(at)
        return rows


class LanePoints:
    """The steps of L tests, as many in every sampling interval as the test with the most takes there.

    Where a test has fewer, and after its end, its last one is repeated with no length: that changes no state.

    Attributes
    ----------
    own
        The steps of every test.
    counts
        Steps of every sampling interval of the longest test, (n,).
    begin, further
        Those that begin a sampling interval, and all others.
    """

    def __init__(self, own: Sequence[StepPoints]) -> None:
        self.own = tuple(own)
        every = [one.counts for one in own]
        self.counts = np.ones(max(map(len, every)), dtype=np.int64)
        for counts in every:
            np.maximum(self.counts[: len(counts)], counts, out=self.counts[: len(counts)])
        interval = np.repeat(np.arange(len(self.counts)), self.counts)
        number = np.arange(len(interval)) - (np.cumsum(self.counts) - self.counts)[interval]
        self.begin, self.further = (self._steps(interval[which], number[which]) for which in (number == 0, number > 0))

    def _steps(self, interval: NDArray[np.intp], number: NDArray[np.intp]) -> LaneSteps:
        """Steps by their sampling interval and their number in it."""
        at, lengths = list[NDArray[np.intp]](), list[FloatArray]()
        for one in self.own:
            there = int(np.searchsorted(interval, len(one.counts)))
            first, last = (np.cumsum(one.counts) - one.counts)[interval[:there]], one.counts[interval[:there]] - 1
            at.append(np.append(first + np.minimum(number[:there], last), len(one.start) - 1))
            lengths.append(np.append(np.where(number[:there] > last, 0.0, one.length[at[-1][:-1]]), 0.0))
        return LaneSteps(len(interval), tuple(at), np.concatenate(lengths))

    @property
    def nbytes(self) -> int:
        """Bytes that it takes, the tests' own steps left out."""
        return self.counts.nbytes + self.begin.nbytes + self.further.nbytes


def lane_points(system: System, experiments: Sequence[ExperimentData], level: StepLevel) -> LanePoints:
    """The steps of tests side by side; those of tests seen before are kept while there is room."""
    own = tuple(step_points(system, one, level) for one in experiments)
    return _points.table(own, lambda: LanePoints(own), {own})


_points = TableCache[LanePoints]()
