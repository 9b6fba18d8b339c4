"""Batches of parameter sets through all tests: outputs, cost, Gauss-Newton terms, sensitivities."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.kernel.drive import Drive
from mofit.kernel.loop import JOB_FIELDS
from mofit.kernel.machine import host
from mofit.kernel.steps import RK4
from mofit.kernel.variant import Rung, Table, Variant
from mofit.model import System

Array = NDArray[np.float64]

#: more sets of values of the parameters that are not free than this, and they go into lanes
_MANY = 4


@dataclass(frozen=True)
class _Block:
    """Parameter sets that go through one test together, padded to full lanes by repeating the last."""

    drive: int
    rows: NDArray[np.intp]
    rung: Rung
    lanes: int
    parameters: Array  # (np, L): free, then fixed
    spread: bool


class Simulator:
    """Runs batches of parameter sets through tests.

    Parameters
    ----------
    system
        The model in vector form.
    drives
        The tests.
    free
        Names of the parameters that results are differentiated by (default: all).
    jobs
        Number of threads. Results are the same, bit for bit, for any number.
    tolerance
        Allowed error of the integration relative to the range of the outputs.
    steps
        Fixed number of Runge-Kutta steps per sampling interval; by default it is chosen from the
        stiffness at each parameter set.

    Raises
    ------
    InputError
        If a test does not fit the system, or a free parameter is unknown.
    """

    def __init__(
        self,
        system: System,
        drives: Sequence[Drive],
        free: Sequence[str] | None = None,
        *,
        jobs: int = 1,
        tolerance: float = 1e-6,
        steps: int | None = None,
    ) -> None:
        self.system, self.drives, self.jobs, self.tolerance = system, tuple(drives), jobs, tolerance
        self.free = tuple(system.parameters if free is None else free)
        unknown = [name for name in self.free if name not in system.parameters]
        raise_errors(
            [Fault(f"parameter '{name}'", "unknown name", did_you_mean(name, system.parameters)) for name in unknown]
            + [fault for drive in self.drives for fault in drive.faults(system)]
        )
        order = [system.parameters.index(name) for name in self.free]
        self._order = order + [index for index in range(len(system.parameters)) if index not in order]
        self._steps = steps
        self._variants: dict[tuple[str, bool, bool, bool], Variant] = {}
        self._pool = ThreadPoolExecutor(jobs) if jobs > 1 else None

    def simulate(self, p: ArrayLike) -> list[Array]:
        """Outputs of every test, each (N, n, ny), for parameter sets ``p`` of shape (N, np)."""
        return [values[..., 0] for values in self._stored(p, derivatives=False)]

    def sensitivities(self, p: ArrayLike) -> list[tuple[Array, Array]]:
        """Outputs (N, n, ny) and their derivatives by the free parameters (N, n, ny, nf), of every test."""
        return [(values[..., 0], values[..., 1:]) for values in self._stored(p, derivatives=True)]

    def cost(self, p: ArrayLike) -> Array:
        r"""Weighted squares :math:`\sum_k \sum_y w_{ky} (y_{ky} - m_{ky})^2` per set and test, (N, T)."""
        return self._reduced(p, derivatives=False)[..., 0]

    def gauss_newton(self, p: ArrayLike) -> tuple[Array, Array, Array]:
        r"""Cost (N, T), :math:`J^T W r` (N, T, nf) and :math:`J^T W J` (N, T, nf, nf), with J = dy/dfree."""
        sums = self._reduced(p, derivatives=True)
        nf = len(self.free)
        normal = np.empty((*sums.shape[:2], nf, nf))
        upper = np.triu_indices(nf)
        normal[..., upper[0], upper[1]] = normal[..., upper[1], upper[0]] = sums[..., 1 + nf :]
        return sums[..., 0], sums[..., 1 : 1 + nf], normal

    def _reduced(self, p: ArrayLike, derivatives: bool) -> Array:
        p = self._checked(p)
        blocks = self._blocks(p)
        nf = len(self.free)
        sums = 1 + (nf + nf * (nf + 1) // 2) * derivatives
        shapes = [(sums, block.lanes) for block in blocks]
        result = np.empty((len(p), len(self.drives), sums))
        for block, values in zip(blocks, self._run(blocks, shapes, derivatives, reduce=True), strict=True):
            result[block.rows, block.drive] = values[:, : len(block.rows)].T
        return result

    def _stored(self, p: ArrayLike, derivatives: bool) -> list[Array]:
        p = self._checked(p)
        blocks = self._blocks(p)
        ny, columns = len(self.system.outputs), 1 + len(self.free) * derivatives
        shapes = [(self.drives[block.drive].samples, columns, ny, block.lanes) for block in blocks]
        result = [np.empty((len(p), drive.samples, ny, columns)) for drive in self.drives]
        for block, values in zip(blocks, self._run(blocks, shapes, derivatives, reduce=False), strict=True):
            result[block.drive][block.rows] = values[..., : len(block.rows)].transpose(3, 0, 2, 1)
        return result

    def _checked(self, p: ArrayLike) -> Array:
        p = np.ascontiguousarray(np.atleast_2d(np.asarray(p, dtype=float)))
        if p.ndim != 2 or p.shape[1] != len(self.system.parameters):
            raise InputError.of(
                "parameter sets",
                f"shape {p.shape} does not end in {len(self.system.parameters)}",
                f"Give one column per parameter: {', '.join(self.system.parameters)}",
            )
        return p

    def _blocks(self, p: Array) -> list[_Block]:
        """Cut the batch into blocks that share a test, the fixed parameters and the way of integration."""
        ordered = np.ascontiguousarray(p[:, self._order])
        fixed = ordered[:, len(self.free) :]
        group, spread = np.zeros(len(p), dtype=int), False
        if fixed.size and np.any(fixed != fixed[0]):
            sets, group = np.unique(fixed, axis=0, return_inverse=True)
            spread = len(sets) > _MANY
            group = np.zeros_like(group) if spread else group.ravel()
        blocks = []
        for index in range(len(self.drives)):
            rungs, choice = self._rungs(index, p)
            for number, rung in enumerate(rungs):
                for which in np.unique(group[choice == number]):
                    rows = np.flatnonzero((choice == number) & (group == which))
                    blocks += self._cut(index, rows, rung, ordered, spread)
        return blocks

    def _cut(self, drive: int, rows: NDArray[np.intp], rung: Rung, ordered: Array, spread: bool) -> list[_Block]:
        narrow = host().width
        blocks = []
        while len(rows):
            lanes = narrow if len(rows) <= narrow else 2 * narrow
            taken, rows = rows[:lanes], rows[lanes:]
            padded = np.concatenate([taken, np.full(lanes - len(taken), taken[-1])])
            blocks.append(_Block(drive, taken, rung, lanes, np.ascontiguousarray(ordered[padded].T), spread))
        return blocks

    def _rungs(self, drive: int, p: Array) -> tuple[list[Rung], NDArray[np.intp]]:
        """The ways of integration of a test and which one every parameter set takes."""
        return [Rung(RK4, self._steps or 1)], np.zeros(len(p), dtype=np.intp)

    def _variant(self, rung: Rung, derivatives: bool, reduce: bool, spread: bool) -> Variant:
        key = (rung.scheme.name, derivatives, reduce, spread)
        if key not in self._variants:
            self._variants[key] = Variant(self.system, self.free, rung.scheme, derivatives, reduce, spread)
        return self._variants[key]

    def _run(
        self, blocks: list[_Block], shapes: Sequence[tuple[int, ...]], derivatives: bool, reduce: bool
    ) -> list[Array]:
        """The result of every block."""
        results = [np.empty(shape) for shape in shapes]
        entries: dict[int, tuple[object, list[int]]] = {}
        records = np.zeros((len(blocks), len(JOB_FIELDS)), dtype=np.int64)
        alive: list[Table] = []
        for index, (block, result) in enumerate(zip(blocks, results, strict=True)):
            variant = self._variant(block.rung, derivatives, reduce, block.spread)
            drive = self.drives[block.drive]
            table = variant.table(drive, block.rung, block.parameters[len(self.free) :, 0])
            code = variant.code(block.rung.steps > 1, block.lanes)
            alive.append(table)
            records[index] = (
                drive.samples,
                block.parameters.ctypes.data,
                table.constant.ctypes.data,
                table.rows.ctypes.data,
                drive.data.ctypes.data,
                table.counts.ctypes.data,
                table.substep_rows.ctypes.data,
                result.ctypes.data,
            )
            entries.setdefault(id(code), (code.entry, []))[1].append(index)
        for entry, members in entries.values():
            # the longest first, so that threads end together
            members.sort(key=lambda i: -self.drives[blocks[i].drive].samples * blocks[i].rung.steps)
            self._call(entry, np.ascontiguousarray(records[members]))
        return results

    def _call(self, entry: object, records: NDArray[np.int64]) -> None:
        counter = ctypes.c_int64(0)
        arguments = (records.ctypes.data, len(records), ctypes.addressof(counter))
        if self._pool is None or len(records) == 1:
            entry(*arguments)  # type: ignore[operator]
            return
        threads = [self._pool.submit(entry, *arguments) for _ in range(min(self.jobs, len(records)))]  # type: ignore[arg-type]
        for thread in threads:
            thread.result()
