"""What one kind of result needs: the graph, its tables, its compiled loops."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.evaluate import evaluate
from mofit.kernel.loop import FIXED, Shape, Split, compile_loop
from mofit.kernel.machine import Code
from mofit.kernel.mesh import Mesh, Rung, build_mesh
from mofit.kernel.program import LANE, contract, trace
from mofit.kernel.steps import GRAPH_INPUTS, Scheme, build_graph
from mofit.model import System

Array = NDArray[np.float64]

#: bytes of tables that a variant keeps
_TABLE_BYTES = 256e6


@dataclass(frozen=True)
class Table:
    """What the lanes of a job read, see `loop.JOB_FIELDS`."""

    constant: Array
    rows: Array
    counts: NDArray[np.int64]
    substep_rows: Array

    @cached_property
    def addresses(self) -> tuple[int, int, int, int]:
        """Where they lie, in this order."""
        return (
            self.constant.ctypes.data,
            self.rows.ctypes.data,
            self.counts.ctypes.data,
            self.substep_rows.ctypes.data,
        )

    @property
    def refined(self) -> bool:
        """Whether some sampling interval takes more than one step."""
        return self.substep_rows.size > 0

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
        self._tables: OrderedDict[tuple[Drive, int, bytes], Table] = OrderedDict()

    def without_tables(self) -> Variant:
        """The same, compiled code shared, with no tables yet."""
        other = copy.copy(self)
        other._tables = OrderedDict()
        return other

    def code(self, refined: bool, lanes: int) -> Code:
        """The compiled loop, with or without further steps within a sampling interval."""
        # a refined loop takes any mesh
        key = (refined or (True, lanes) in self._codes, lanes)
        if key not in self._codes:
            substep = self.substep if refined else None
            self._codes[key] = compile_loop(self.sample, substep, self.shape, self.reduce, lanes)
        return self._codes[key]

    def table(self, drive: Drive, rung: Rung, switches: tuple[Array, Array], fixed: Array) -> Table:
        """The table of a test for the parameters that all lanes share."""
        key = (drive, rung.steps, b"" if self.spread else fixed.tobytes())
        found = self._tables.pop(key, None)
        if found is None:
            found = self._table(drive, build_mesh(drive, rung, switches), fixed)
            while self._tables and sum(table.nbytes for table in self._tables.values()) > _TABLE_BYTES:
                self._tables.popitem(last=False)
        self._tables[key] = found
        return found

    def _table(self, drive: Drive, mesh: Mesh, fixed: Array) -> Table:
        first = np.concatenate([[0], np.cumsum(mesh.counts)[:-1]])
        further = np.delete(np.arange(len(mesh.start)), first)
        constant, rows = self._evaluated(self.sample, drive, mesh.start[first], mesh.end[first], fixed)
        if not len(further):
            return Table(constant, rows, mesh.counts - 1, np.empty((0, 0)))
        more, substep_rows = self._evaluated(self.substep, drive, mesh.start[further], mesh.end[further], fixed)
        return Table(np.concatenate([constant, more]), rows, mesh.counts - 1, substep_rows)

    def _evaluated(self, split: Split, drive: Drive, start: Array, end: Array, fixed: Array) -> tuple[Array, Array]:
        """Constant values and rows of the table, for steps from ``start`` to ``end``."""
        count, length = len(start), end - start

        def everywhere(values: Array) -> Array:
            return np.broadcast_to(np.asarray(values, dtype=float)[:, None], (len(values), count))

        points = {
            # no lane's: never read
            "free": np.empty((0, count)),
            "state": np.empty((0, count)),
            "input": np.concatenate(
                [drive.at(end if node == 1 else start + node * length) for node in self.scheme.nodes]
            ),
            "slope": drive.slope(start),
            "first": everywhere(drive.at(np.zeros(1))[:, 0]),
            "fixed": everywhere(fixed),
            "condition": everywhere(drive.conditions),
            "h": length[None],
        }
        values = evaluate(split.table, [points[name] for name in GRAPH_INPUTS])
        cut = len(split.constant)
        return values[:cut, 0].copy(), np.ascontiguousarray(values[cut:].T)
