"""What one kind of result needs: the graph, its tables, its compiled loops."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.evaluate import evaluate
from mofit.kernel.loop import FIXED, Shape, Split, compile_loop
from mofit.kernel.machine import Code
from mofit.kernel.program import LANE, contract, trace
from mofit.kernel.steps import GRAPH_INPUTS, Scheme, build_graph
from mofit.model import System

Array = NDArray[np.float64]

#: bytes of tables that a variant keeps
_TABLE_BYTES = 256e6


@dataclass(frozen=True)
class Rung:
    """How a test is integrated: the method and its number of steps per sampling interval."""

    scheme: Scheme
    steps: int


@dataclass(frozen=True)
class Table:
    """What the lanes of a job read, see `loop.JOB_FIELDS`."""

    constant: Array
    rows: Array
    counts: NDArray[np.int64]
    substep_rows: Array

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        return self.constant.nbytes + self.rows.nbytes + self.counts.nbytes + self.substep_rows.nbytes


class Variant:
    """Outputs or weighted sums, with or without derivatives, by one scheme.

    Parameters
    ----------
    system, free, scheme
        What is integrated, differentiated by which parameters, and how.
    derivatives
        Whether sensitivities are propagated.
    reduce
        Whether samples are summed up (cost, Gauss-Newton) or stored.
    spread
        Whether the parameters that are not free differ between lanes too; the numbers are the
        same, but less is worked out in tables.
    """

    def __init__(
        self, system: System, free: Sequence[str], scheme: Scheme, derivatives: bool, reduce: bool, spread: bool
    ) -> None:
        self.reduce, self.scheme, self.spread = reduce, scheme, spread
        self.shape = Shape(len(system.states), len(system.outputs), len(free), derivatives)
        levels = tuple(GRAPH_INPUTS.values())
        program = contract(trace(build_graph(system, scheme, free, derivatives)), levels)
        if spread:
            levels = tuple(LANE if index == FIXED else level for index, level in enumerate(levels))
        self.sample = Split(program, levels, (0, 1, 2))
        self.substep = Split(program, levels, (1,))
        self._codes: dict[tuple[bool, int], Code] = {}
        self._tables: OrderedDict[tuple[int, int, bytes], Table] = OrderedDict()

    def code(self, refined: bool, lanes: int) -> Code:
        """The compiled loop, with or without further steps within a sampling interval."""
        key = (refined, lanes)
        if key not in self._codes:
            substep = self.substep if refined else None
            self._codes[key] = compile_loop(self.sample, substep, self.shape, self.reduce, lanes)
        return self._codes[key]

    def table(self, drive: Drive, rung: Rung, fixed: Array) -> Table:
        """The table of a test for the parameters that all lanes share."""
        key = (id(drive), rung.steps, b"" if self.spread else fixed.tobytes())
        found = self._tables.get(key)
        if found is None:
            found = self._table(drive, rung, fixed)
            while self._tables and sum(table.nbytes for table in self._tables.values()) > _TABLE_BYTES:
                self._tables.popitem(last=False)
        else:
            self._tables.move_to_end(key)
        self._tables[key] = found
        return found

    def _table(self, drive: Drive, rung: Rung, fixed: Array) -> Table:
        h = drive.step / rung.steps
        start = np.arange(drive.samples) * drive.step
        constant, rows = self._evaluated(self.sample, drive, start, h, fixed)
        counts = np.full(drive.samples, rung.steps - 1)
        if rung.steps == 1:
            return Table(constant, rows, counts, np.empty((0, 0)))
        further = (start[:, None] + h * np.arange(1, rung.steps)).ravel()
        constant_too, substep_rows = self._evaluated(self.substep, drive, further, h, fixed)
        return Table(np.concatenate([constant, constant_too]), rows, counts, substep_rows)

    def _evaluated(self, split: Split, drive: Drive, time: Array, h: float, fixed: Array) -> tuple[Array, Array]:
        """Constant values and rows of the table, for steps of length ``h`` that start at ``time``."""
        count = len(time)

        def everywhere(values: Array) -> Array:
            return np.broadcast_to(np.asarray(values, dtype=float)[:, None], (len(values), count))

        points = {
            # no lane's: never read
            "free": np.empty((0, count)),
            "state": np.empty((0, count)),
            "input": np.concatenate([drive.at(time + node * h) for node in self.scheme.nodes]),
            "slope": drive.slope(time),
            "first": everywhere(drive.at(np.zeros(1))[:, 0]),
            "fixed": everywhere(fixed),
            "condition": everywhere(drive.conditions),
            "h": np.full((1, count), h),
        }
        values = evaluate(split.table, [points[name] for name in GRAPH_INPUTS])
        cut = len(split.constant)
        return values[:cut, 0].copy(), np.ascontiguousarray(values[cut:].T)
