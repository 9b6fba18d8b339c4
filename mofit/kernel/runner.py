"""Parameter sets cut into blocks of lanes, blocks handed to threads."""

from __future__ import annotations

import copy
import ctypes
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.loop import JOB_FIELDS, Shape
from mofit.kernel.machine import host
from mofit.kernel.mesh import Rung, find_switches
from mofit.kernel.variant import Table, Variant
from mofit.model import System

Array = NDArray[np.float64]

#: up to so many vectors carried from sample to sample, four registers for each still pay
_FEW_CARRIED = 20
#: more sets of values of the parameters that are not free than this, and they go into lanes
_MANY = 4


@dataclass(frozen=True)
class Choice:
    """The ways to integrate one test and which of them each parameter set takes (-1: none)."""

    rungs: tuple[Rung, ...]
    taken: NDArray[np.intp]


@dataclass(frozen=True)
class _Block:
    """Parameter sets that go through a test together, padded to full lanes by repeating the last."""

    rows: NDArray[np.intp]
    rung: Rung
    lanes: int
    parameters: Array  # (np, L): free, then fixed
    spread: bool

    @cached_property
    def address(self) -> int:
        """Of the parameters."""
        return self.parameters.ctypes.data


def _lane_counts(shape: Shape) -> tuple[int, int]:
    """Lanes of a small and of a large block: enough to hide latency, as few as registers suffice for.

    A step is a chain of dependent operations. Without derivatives two registers side by side take no longer
    than one, and four little longer; with many sums to carry along, four spill more than they hide.
    """
    width = host().width
    if not shape.derivatives:
        return 2 * width, 4 * width
    carried = shape.states * shape.columns + shape.sums
    return width, 4 * width if carried <= _FEW_CARRIED else 2 * width


def _until(switches: tuple[Array, Array], drive: Drive) -> tuple[Array, Array]:
    """The switches before the end of a drive."""
    before, after = switches
    kept = after < (drive.samples - 1) * drive.step
    return before[kept], after[kept]


@cache
def _threads(process: int, jobs: int) -> ThreadPoolExecutor:
    """So many threads of this process: a forked one has none of its parent's."""
    return ThreadPoolExecutor(jobs)


class Runner:
    """Runs parameter sets through tests, integrated as told.

    Parameters
    ----------
    system, drives, free
        As for `Simulator`.
    jobs
        Number of threads.
    lean
        Whether to compile one loop for everything rather than the fastest for every case.
    """

    def __init__(
        self, system: System, drives: Sequence[Drive], free: Sequence[str], jobs: int, lean: bool = False
    ) -> None:
        self.system, self.drives, self.free, self.jobs = system, tuple(drives), tuple(free), jobs
        self._lean = lean
        order = [system.parameters.index(name) for name in self.free]
        self._order = order + [index for index in range(len(system.parameters)) if index not in order]
        self._switches = [find_switches(system, drive) for drive in self.drives]
        # compiled for all tests, and with the tables of these
        self._compiled: dict[tuple[str, bool, bool, bool], Variant] = {}
        self._variants: dict[tuple[str, bool, bool, bool], Variant] = {}

    def select(self, index: Sequence[int]) -> Runner:
        """The same on some of the tests; compiled code and tables are shared."""
        other = copy.copy(self)
        other.drives = tuple(self.drives[i] for i in index)
        other._switches = [self._switches[i] for i in index]
        return other

    def with_drives(self, drives: Sequence[Drive]) -> Runner:
        """The same with other drives whose inputs are those of the former as far as they go."""
        other = copy.copy(self)
        other.drives = tuple(drives)
        other._switches = [_until(own, drive) for own, drive in zip(self._switches, drives, strict=True)]
        return other

    def on_tests(self, drives: Sequence[Drive]) -> Runner:
        """The same on other tests; compiled code is shared, tables are not."""
        other = copy.copy(self)
        other.drives = tuple(drives)
        other._variants = {}
        other._switches = [find_switches(self.system, drive) for drive in drives]
        return other

    def _shape(self, derivatives: bool) -> Shape:
        return Shape(len(self.system.states), len(self.system.outputs), len(self.free), derivatives)

    def reduced(self, p: Array, choices: Sequence[Choice], derivatives: bool) -> Array:
        """Sums (see `loop.Shape.sums`) per parameter set and test."""
        blocks = self._blocks(p, choices, derivatives)
        sums = self._shape(derivatives).sums
        shapes = [(sums, block.lanes) for _, block in blocks]
        result = np.full((len(p), len(self.drives), sums), np.nan)
        for (drive, block), values in zip(blocks, self._run(blocks, shapes, derivatives, reduce=True), strict=True):
            result[block.rows, drive] = values[:, : len(block.rows)].T
        return result

    def stored(self, p: Array, choices: Sequence[Choice], derivatives: bool, kept: slice = slice(None)) -> list[Array]:
        """Outputs (those that are kept) and their derivatives, (N, n, ny, 1 + nf) per test."""
        blocks = self._blocks(p, choices, derivatives)
        ny, columns = len(self.system.outputs), 1 + len(self.free) * derivatives
        shapes = [(self.drives[drive].samples, columns, ny, block.lanes) for drive, block in blocks]
        count = len(range(ny)[kept])
        result = [np.full((len(p), drive.samples, count, columns), np.nan) for drive in self.drives]
        for (drive, block), values in zip(blocks, self._run(blocks, shapes, derivatives, reduce=False), strict=True):
            result[drive][block.rows] = values[:, :, kept, : len(block.rows)].transpose(3, 0, 2, 1)
        return result

    def _blocks(self, p: Array, choices: Sequence[Choice], derivatives: bool) -> list[tuple[int, _Block]]:
        """The batch in blocks that share a test (its index), the fixed parameters and the way of integration."""
        ordered = np.ascontiguousarray(p[:, self._order])
        fixed = ordered[:, len(self.free) :]
        group, spread = np.zeros(len(p), dtype=int), False
        if fixed.size and np.any(fixed != fixed[0]):
            sets, group = np.unique(fixed, axis=0, return_inverse=True)
            spread = len(sets) > _MANY
            group = np.zeros_like(group) if spread else group.ravel()
        sizes = _lane_counts(self._shape(derivatives))
        cut: dict[int, list[_Block]] = {}  # the same choice for several tests is the same blocks
        for choice in choices:
            if id(choice) in cut:
                continue
            cut[id(choice)] = []
            for number in np.unique(choice.taken[choice.taken >= 0]):
                takes = choice.taken == number
                for which in np.unique(group[takes]):
                    rows = np.flatnonzero(takes & (group == which))
                    cut[id(choice)] += self._cut(rows, choice.rungs[number], ordered, spread, sizes)
        return [(index, block) for index, choice in enumerate(choices) for block in cut[id(choice)]]

    def _cut(
        self, rows: NDArray[np.intp], rung: Rung, ordered: Array, spread: bool, sizes: tuple[int, int]
    ) -> list[_Block]:
        narrow, wide = sizes
        narrow = wide if self._lean else narrow
        blocks = []
        while len(rows):
            lanes = wide if len(rows) > wide // 2 else narrow
            taken, rows = rows[:lanes], rows[lanes:]
            padded = np.concatenate([taken, np.full(lanes - len(taken), taken[-1])])
            blocks.append(_Block(taken, rung, lanes, np.ascontiguousarray(ordered[padded].T), spread))
        return blocks

    def _variant(self, rung: Rung, derivatives: bool, reduce: bool, spread: bool) -> Variant:
        key = (rung.scheme.name, derivatives, reduce, spread)
        if key not in self._variants:
            if key not in self._compiled:
                self._compiled[key] = Variant(self.system, self.free, rung.scheme, derivatives, reduce, spread)
            self._variants[key] = self._compiled[key].without_tables()
        return self._variants[key]

    def _run(
        self, blocks: list[tuple[int, _Block]], shapes: Sequence[tuple[int, ...]], derivatives: bool, reduce: bool
    ) -> list[Array]:
        """The result of every block."""
        bounds = [0, *np.cumsum([math.prod(shape) for shape in shapes]).tolist()]
        whole = np.empty(bounds[-1])
        place = whole.ctypes.data
        entries: dict[int, tuple[Callable[..., None], list[int]]] = {}
        records = np.zeros((len(blocks), len(JOB_FIELDS)), dtype=np.int64)
        alive: list[Table] = []
        for index, (test, block) in enumerate(blocks):
            variant = self._variant(block.rung, derivatives, reduce, block.spread)
            drive = self.drives[test]
            table = variant.table(drive, block.rung, self._switches[test], block.parameters[len(self.free) :, 0])
            code = variant.code(table.refined or self._lean, block.lanes)
            alive.append(table)
            constant, rows, counts, substep_rows = table.addresses
            result = place + whole.itemsize * bounds[index]
            records[index] = (
                drive.samples, block.address, constant, rows, drive.address, counts, substep_rows, result
            )  # fmt: skip
            entries.setdefault(id(code), (code.entry, []))[1].append(index)
        for entry, members in entries.values():
            # the longest first, so that threads end together
            members.sort(key=lambda i: -self.drives[blocks[i][0]].samples * blocks[i][1].rung.steps)
            self._call(entry, np.ascontiguousarray(records[members]))
        return [whole[start:end].reshape(shape) for start, end, shape in zip(bounds, bounds[1:], shapes, strict=False)]

    def _call(self, entry: Callable[..., None], records: NDArray[np.int64]) -> None:
        counter = ctypes.c_int64(0)
        arguments = (records.ctypes.data, len(records), ctypes.addressof(counter))
        helpers: list[Future[None]] = []
        if (count := min(self.jobs, len(records)) - 1) > 0:
            pool = _threads(os.getpid(), self.jobs - 1)
            helpers = [pool.submit(entry, *arguments) for _ in range(count)]
        entry(*arguments)
        for helper in helpers:
            if not helper.cancel():  # one that has not begun by now finds nothing left to do
                helper.result()
