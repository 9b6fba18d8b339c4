"""Parameter sets cut into blocks of lanes, and blocks handed to threads."""

from __future__ import annotations

import copy
import ctypes
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.compiler.loop import JOB_FIELDS, Shape
from mofit.simulation.compiler.machine import host
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import free_first
from mofit.simulation.kernel import Kernel, Table
from mofit.simulation.table_cache import TableCache
from mofit.simulation.time_grid import StepChoice, StepLevel

#: up to so many vectors carried from sample to sample, four registers for each still pay
_FEW_CARRIED = 20
#: more sets of values of the parameters that are not free than this, and they go into lanes
_MANY_SETS = 4
#: bytes of tables and results that are worked on together
_AT_ONCE_BYTES = 3e7

#: scheme, derivatives, reduce, fixed parameters per lane
KernelKey = tuple[str, bool, bool, bool]
#: kernel, test, steps, fixed parameters
TableKey = tuple[KernelKey, ExperimentData, int, bytes]


@dataclass(frozen=True)
class _Block:
    """Parameter sets that go through a test together, padded to full lanes by repeating the last."""

    rows: NDArray[np.intp]
    level: StepLevel
    lanes: int
    parameters: FloatArray  # (np, L): free, then fixed
    fixed_per_lane: bool

    @cached_property
    def address(self) -> int:
        """Of the parameters in memory."""
        return self.parameters.ctypes.data


@dataclass(frozen=True, eq=False)
class _Job:
    """A block on its way through a test, and where its result goes."""

    test: int
    block: _Block
    experiment: ExperimentData
    table: Table
    entry: Callable[..., None]
    data: FloatArray | None
    """What is measured; None for loops that do not read it."""
    result: FloatArray

    @property
    def record(self) -> tuple[int, ...]:
        """The addresses that the compiled loop takes, see `loop.JOB_FIELDS`."""
        constant, rows, counts, substep_rows = self.table.addresses
        data = 0 if self.data is None else self.data.ctypes.data
        return (
            self.experiment.samples, self.block.address, constant, rows, data, counts, substep_rows,
            self.result.ctypes.data, len(self.block.rows),
        )  # fmt: skip


def _lane_counts(shape: Shape) -> tuple[int, int]:
    """Lanes of a small and of a large block: enough to hide latency, as few as registers suffice for.

    A step is a chain of dependent operations. Without derivatives two registers side by side take no longer
    than one, and four little longer; with many sums to carry along there is enough to do beside, and two spill.
    """
    width = host().width
    if not shape.derivatives:
        return 2 * width, 4 * width
    carried = shape.states * shape.columns + shape.sums
    return width, 4 * width if carried <= _FEW_CARRIED else width


def _room(shape: tuple[int, ...], lanes: int) -> FloatArray:
    """An array for what a loop stores; the last vector of lanes reaches beyond its end."""
    count = math.prod(shape)
    return np.empty(count + lanes)[:count].reshape(shape)


@cache
def _threads(process: int, jobs: int) -> ThreadPoolExecutor:
    """So many threads of this process: a forked one has none of its parent's."""
    return ThreadPoolExecutor(jobs)


class Scheduler:
    """Runs parameter sets through tests at given step levels; system, free and jobs as for `Simulator`.

    Parameter sets have shape (N, np), or (N, T, np) where each test has its own values. With ``one_loop`` one loop is
    compiled for all cases rather than the fastest for each. With ``fixed_per_lane`` parameters that are not free go
    into lanes in any case: right where they change from call to call.
    """

    def __init__(
        self, system: System, free: Sequence[str], jobs: int, one_loop: bool = False, fixed_per_lane: bool = False
    ) -> None:
        self.system, self.free, self.jobs = system, tuple(free), jobs
        self._order = free_first(system.parameters, free)
        self._one_loop, self._fixed_per_lane = one_loop, fixed_per_lane
        self._kernels: dict[KernelKey, Kernel] = {}
        self._tables = TableCache[Table]()

    def without_tables(self) -> Scheduler:
        """The same, compiled code shared, with no tables yet."""
        other = copy.copy(self)
        other._tables = TableCache[Table]()
        return other

    def reduced(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> FloatArray:
        """Sums per set, test and output (see `loop.Shape.terms`), (N, T, ny, terms); nan where no level is taken."""
        shape = self._shape(derivatives)
        result = np.full((len(p), len(experiments), shape.sums), np.nan)
        for test, rows, values in self._run(experiments, p, choices, derivatives, reduce=True):
            result[rows, test] = values[:, : len(rows)].T
        return result.reshape(len(p), len(experiments), shape.outputs, shape.terms)

    def stored(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        choices: Sequence[StepChoice],
        derivatives: bool,
        kept: slice = slice(None),
    ) -> list[FloatArray]:
        """Outputs (those that are kept) and their derivatives, (N, n, ny, 1 + nf) per test."""
        columns = self._shape(derivatives).columns
        count = len(range(len(self.system.outputs))[kept])
        # samples last in memory: what follows works along them
        shapes = [(len(p), count, columns, experiment.recorded) for experiment in experiments]
        result = [np.full(shape, np.nan).transpose(0, 3, 1, 2) for shape in shapes]
        for test, rows, values in self._run(experiments, p, choices, derivatives, reduce=False):
            result[test][rows] = values[experiments[test].lead :, :, kept].transpose(3, 0, 2, 1)
        return result

    def _shape(self, derivatives: bool) -> Shape:
        return Shape(len(self.system.states), len(self.system.outputs), len(self.free), derivatives)

    def _blocks(self, p: FloatArray, choices: Sequence[StepChoice], derivatives: bool) -> list[tuple[int, _Block]]:
        """The batch in blocks that share a test (its index), the fixed parameters and the step level."""
        alike: dict[int, list[int]] = {}  # the same choice for several tests is the same blocks
        for test, choice in enumerate(choices):
            alike.setdefault(id(choice) if p.ndim == 2 or self._fixed_per_lane else test, []).append(test)
        blocks: dict[int, list[_Block]] = {}
        for tests in alike.values():
            sets = p[:, tests] if p.ndim == 3 else p[:, None]
            found = self._cut(sets, choices[tests[0]], derivatives)
            blocks |= dict(zip(tests, found * (len(tests) // len(found)), strict=True))
        return [(test, block) for test in range(len(choices)) for block in blocks[test]]

    def _cut(self, p: FloatArray, choice: StepChoice, derivatives: bool) -> list[list[_Block]]:
        """The blocks of each of several tests, from their parameter sets (N, tests, np)."""
        ordered = p[..., self._order]
        fixed = ordered[:, 0, len(self.free) :]
        group, per_lane = np.zeros(len(p), dtype=int), self._fixed_per_lane
        if not per_lane and fixed.size and np.any(fixed != fixed[0]):
            sets, group = np.unique(fixed, axis=0, return_inverse=True)
            per_lane = len(sets) > _MANY_SETS
            group = np.zeros_like(group) if per_lane else group.ravel()
        small, large = _lane_counts(self._shape(derivatives))
        small = large if self._one_loop else small
        found: list[list[_Block]] = [[] for _ in range(p.shape[1])]
        for number in np.unique(choice.taken[choice.taken >= 0]):
            for which in np.unique(group[choice.taken == number]):
                rows = np.flatnonzero((choice.taken == number) & (group == which))
                while len(rows):
                    lanes = large if len(rows) > large // 2 else small
                    taken, rows = rows[:lanes], rows[lanes:]
                    padded = np.concatenate([taken, np.full(lanes - len(taken), taken[-1])])
                    values = np.ascontiguousarray(ordered[padded].transpose(1, 2, 0))
                    for own, parameters in zip(found, values, strict=True):
                        own.append(_Block(taken, choice.levels[number], lanes, parameters, per_lane))
        return found

    def _kernel(self, key: KernelKey, level: StepLevel) -> Kernel:
        if key not in self._kernels:
            self._kernels[key] = Kernel(self.system, self.free, level.scheme, *key[1:])
        return self._kernels[key]

    def _table(
        self, key: KernelKey, kernel: Kernel, experiment: ExperimentData, block: _Block, used: set[TableKey]
    ) -> Table:
        """The table of a test for a block's level and fixed parameters; those that this call has ``used`` stay."""
        fixed = block.parameters[len(self.free) :, 0]
        known = (key, experiment, block.level.steps, b"" if block.fixed_per_lane else fixed.tobytes())
        used.add(known)
        return self._tables.table(known, lambda: kernel.table(experiment, block.level, fixed), used)

    def _run(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        choices: Sequence[StepChoice],
        derivatives: bool,
        reduce: bool,
    ) -> Iterator[tuple[int, NDArray[np.intp], FloatArray]]:
        """Test, parameter sets and result of every block: (sums, L) or (samples, 1 + nf, outputs, sets).

        So many at once as memory allows.
        """
        shape = self._shape(derivatives)
        jobs: list[_Job] = []
        load, used, seen, packed = 0, set[TableKey](), set[int](), dict[int, FloatArray]()
        for test, block in self._blocks(p, choices, derivatives):
            key = (block.level.scheme.name, derivatives, reduce, block.fixed_per_lane)
            kernel, experiment = self._kernel(key, block.level), experiments[test]
            table = self._table(key, kernel, experiment, block, used)
            code = kernel.code(table.refined or self._one_loop, block.lanes)
            if reduce:
                if test not in packed:
                    packed[test] = experiment.packed()
                    load += packed[test].nbytes
                result = np.empty((shape.sums, block.lanes))
            else:
                result = _room((experiment.samples, shape.columns, shape.outputs, len(block.rows)), block.lanes)
            jobs.append(_Job(test, block, experiment, table, code.entry, packed.get(test), result))
            load += result.nbytes + (table.nbytes if id(table) not in seen else 0)
            seen.add(id(table))
            if load > _AT_ONCE_BYTES:
                yield from self._done(jobs)
                jobs, load, seen, packed = [], 0, set(), {}
        yield from self._done(jobs)

    def _done(self, jobs: Sequence[_Job]) -> Iterator[tuple[int, NDArray[np.intp], FloatArray]]:
        """The results of jobs that run together."""
        entries: dict[int, list[_Job]] = {}
        for job in jobs:
            entries.setdefault(id(job.entry), []).append(job)
        for members in entries.values():
            # the longest first, so that threads end together
            members.sort(key=lambda job: -job.experiment.samples * job.block.level.steps)
            records = np.array([job.record for job in members], dtype=np.int64).reshape(-1, len(JOB_FIELDS))
            self._call(members[0].entry, records)
        for job in jobs:
            yield job.test, job.block.rows, job.result

    def _call(self, entry: Callable[..., None], records: NDArray[np.int64]) -> None:
        """Run jobs in this thread and in as many others as there is work for."""
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
