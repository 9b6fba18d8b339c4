"""What goes through a compiled loop: blocks of parameter sets, and the jobs that they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.simulation.compiler.loop import Shape
from mofit.simulation.compiler.machine import host
from mofit.simulation.kernel import Table
from mofit.simulation.time_grid import StepLevel

#: up to so many vectors carried from sample to sample, four registers for each still pay
_FEW_CARRIED = 20
#: test, its parameter sets, and where they are in the result of a job: the last axis
End = tuple[int, NDArray[np.intp], slice]


@dataclass(frozen=True)
class Block:
    """Parameter sets that go through a test together, padded to full lanes by repeating the last."""

    rows: NDArray[np.intp]
    level: StepLevel
    lanes: int
    parameters: FloatArray  # (np, L): free, then fixed
    fixed_per_lane: bool


@dataclass(frozen=True, eq=False)
class Job:
    """What a loop runs through, and where its result goes."""

    samples: int
    steps: int
    parameters: FloatArray  # (np, L): free, then fixed
    table: Table
    entry: Callable[..., None]
    data: FloatArray | None
    """What is measured; None for loops that do not read it."""
    result: FloatArray
    kept: int
    ends: Sequence[End]

    @property
    def record(self) -> tuple[int, ...]:
        """The addresses that the compiled loop takes, see `loop.JOB_FIELDS`."""
        constant, rows, counts, substep_rows = self.table.addresses
        data = 0 if self.data is None else self.data.ctypes.data
        return (
            self.samples, self.parameters.ctypes.data, constant, rows, data, counts, substep_rows,
            self.result.ctypes.data, self.kept,
        )  # fmt: skip


def lane_counts(shape: Shape) -> tuple[int, int]:
    """Lanes of a small and of a large block: enough to hide latency, as few as registers suffice for.

    A step is a chain of dependent operations. Without derivatives two registers side by side take no longer
    than one, and four little longer; with many sums to carry along there is enough to do beside, and two spill.
    """
    width = host().width
    if not shape.derivatives:
        return 2 * width, 4 * width
    carried = shape.states * shape.columns + shape.sums
    return width, 4 * width if carried <= _FEW_CARRIED else width


def room(shape: tuple[int, ...], lanes: int) -> FloatArray:
    """An array for what a loop stores; the last vector of lanes reaches beyond its end."""
    count = math.prod(shape)
    return np.empty(count + lanes)[:count].reshape(shape)
