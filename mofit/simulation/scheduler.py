"""Parameter sets cut into blocks of lanes, and blocks handed to threads."""

from __future__ import annotations

import copy
import ctypes
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.runtime.parallel import threads
from mofit.simulation.compiler.loop import JOB_FIELDS, Shape
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import free_first
from mofit.simulation.kernel import Kernel, Table
from mofit.simulation.loop_jobs import Block, Job, lane_counts, room
from mofit.simulation.table_cache import TableCache
from mofit.simulation.time_grid import StepChoice, StepLevel

#: more sets of values of the parameters that are not free than this, and they go into lanes
_MANY_SETS = 4
#: bytes of tables and results that are worked on together
_AT_ONCE_BYTES = 3e7
#: So many times the work of a test at a time may be that of tests side by side: one table is made of them all.
_SIDE_BY_SIDE = 2
#: Most steps of all lanes together of tests side by side: beyond that a test at a time takes less memory.
_MOST_STEPS = 300_000

#: scheme, derivatives, reduce, fixed parameters per lane
KernelKey = tuple[str, bool, bool, bool]
#: kernel, test (or those of the lanes), steps, fixed parameters
TableKey = tuple[KernelKey, ExperimentData | tuple[ExperimentData, ...], int, bytes]


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
        for test, rows, values in self._run(self._jobs(experiments, p, choices, derivatives, reduce=True)):
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
        groups = self._side_by_side(experiments, p, choices, derivatives)
        alone = [test for test in range(len(experiments)) if not any(test in tests for _, tests in groups)]
        used = set[TableKey]()
        jobs = chain(
            *(self._of_lanes(experiments, p, level, tests, derivatives, used) for level, tests in groups),
            self._jobs(experiments, p, choices, derivatives, reduce=False, tests=alone),
        )
        for test, rows, values in self._run(jobs):
            record = slice(experiments[test].lead, experiments[test].samples)
            result[test][rows] = values[record, :, kept].transpose(3, 0, 2, 1)
        return result

    def _shape(self, derivatives: bool) -> Shape:
        return Shape(len(self.system.states), len(self.system.outputs), len(self.free), derivatives)

    def _blocks(
        self, p: FloatArray, choices: Sequence[StepChoice], derivatives: bool, tests: Sequence[int]
    ) -> list[tuple[int, Block]]:
        """The batch in blocks that share a test (its index), the fixed parameters and the step level."""
        alike: dict[int, list[int]] = {}  # the same choice for several tests is the same blocks
        for test in tests:
            alike.setdefault(id(choices[test]) if p.ndim == 2 or self._fixed_per_lane else test, []).append(test)
        blocks: dict[int, list[Block]] = {}
        for own in alike.values():
            sets = p[:, own] if p.ndim == 3 else p[:, None]
            found = self._cut(sets, choices[own[0]], derivatives)
            blocks |= dict(zip(own, found * (len(own) // len(found)), strict=True))
        return [(test, block) for test in tests for block in blocks[test]]

    def _side_by_side(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> list[tuple[StepLevel, list[int]]]:
        """Tests that go through a loop together, one per lane, with their level: where sets would fill few lanes."""
        if not self._fixed_per_lane:
            return []
        alike: dict[StepLevel, list[int]] = {}
        for test, choice in enumerate(choices):
            # a step of no length is none for an implicit method
            if len(choice.levels) == 1 and choice.levels[0].scheme.explicit and not choice.taken.any():
                alike.setdefault(choice.levels[0], []).append(test)
        lanes, found = lane_counts(self._shape(derivatives))[0], list[tuple[StepLevel, list[int]]]()
        for level, tests in alike.items():
            samples = [experiments[test].samples for test in tests]
            longest = [tests[at] for at in np.argsort(samples, kind="stable")[::-1]]
            groups = [longest[first : first + lanes] for first in range(0, len(longest), lanes)]
            together = len(p) * sum(experiments[first].samples for first, *_ in groups)
            few = max(samples) * level.steps * lanes <= _MOST_STEPS
            if few and len(tests) > 1 and together <= _SIDE_BY_SIDE * sum(samples) * math.ceil(len(p) / lanes):
                found += [(level, group) for group in groups]
        return found

    def _of_lanes(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        level: StepLevel,
        tests: Sequence[int],
        derivatives: bool,
        used: set[TableKey],
    ) -> Iterator[Job]:
        """A job per parameter set, for tests side by side; the last one fills the lanes that are left."""
        shape, lanes = self._shape(derivatives), lane_counts(self._shape(derivatives))[0]
        key, every = (level.scheme.name, derivatives, False, True), [*tests, *[tests[-1]] * (lanes - len(tests))]
        kernel, own = self._kernel(key, level), tuple(experiments[test] for test in tests)
        known = (key, own, level.steps, b"")
        used.add(known)
        table = self._tables.table(known, lambda: kernel.table_of_lanes(own, lanes, level), used)
        samples = own[0].samples
        entry = kernel.code(table.refined, lanes, len(p) * samples * level.steps, own_tables=True).entry
        for number, values in enumerate(p[..., self._order]):
            sets = values[every] if values.ndim == 2 else np.broadcast_to(values, (lanes, len(values)))
            parameters = np.ascontiguousarray(sets.T)
            result = np.empty((samples, shape.columns, shape.outputs, lanes))
            ends = [(test, np.array([number]), slice(lane, lane + 1)) for lane, test in enumerate(tests)]
            yield Job(samples, level.steps, parameters, table, entry, None, result, lanes, ends)

    def _cut(self, p: FloatArray, choice: StepChoice, derivatives: bool) -> list[list[Block]]:
        """The blocks of each of several tests, from their parameter sets (N, tests, np)."""
        ordered = p[..., self._order]
        fixed = ordered[:, 0, len(self.free) :]
        group, per_lane = np.zeros(len(p), dtype=int), self._fixed_per_lane
        if not per_lane and fixed.size and np.any(fixed != fixed[0]):
            sets, group = np.unique(fixed, axis=0, return_inverse=True)
            per_lane = len(sets) > _MANY_SETS
            group = np.zeros_like(group) if per_lane else group.ravel()
        small, large = lane_counts(self._shape(derivatives))
        small = large if self._one_loop else small
        found: list[list[Block]] = [[] for _ in range(p.shape[1])]
        for number in np.unique(choice.taken[choice.taken >= 0]):
            for which in np.unique(group[choice.taken == number]):
                rows = np.flatnonzero((choice.taken == number) & (group == which))
                while len(rows):
                    lanes = large if len(rows) > large // 2 else small
                    taken, rows = rows[:lanes], rows[lanes:]
                    padded = np.concatenate([taken, np.full(lanes - len(taken), taken[-1])])
                    values = np.ascontiguousarray(ordered[padded].transpose(1, 2, 0))
                    for own, parameters in zip(found, values, strict=True):
                        own.append(Block(taken, choice.levels[number], lanes, parameters, per_lane))
        return found

    def _kernel(self, key: KernelKey, level: StepLevel) -> Kernel:
        if key not in self._kernels:
            self._kernels[key] = Kernel(self.system, self.free, level.scheme, *key[1:])
        return self._kernels[key]

    def _table(
        self, key: KernelKey, kernel: Kernel, experiment: ExperimentData, block: Block, used: set[TableKey]
    ) -> Table:
        """The table of a test for a block's level and fixed parameters; those that this call has ``used`` stay."""
        fixed = block.parameters[len(self.free) :, 0]
        known = (key, experiment, block.level.steps, b"" if block.fixed_per_lane else fixed.tobytes())
        used.add(known)
        return self._tables.table(known, lambda: kernel.table(experiment, block.level, fixed), used)

    def _jobs(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        choices: Sequence[StepChoice],
        derivatives: bool,
        reduce: bool,
        tests: Sequence[int] | None = None,
    ) -> Iterator[Job]:
        """A job per block of parameter sets of every test, or of some."""
        shape, used = self._shape(derivatives), set[TableKey]()
        data, of = None, -1
        for test, block in self._blocks(p, choices, derivatives, range(len(choices)) if tests is None else tests):
            key = (block.level.scheme.name, derivatives, reduce, block.fixed_per_lane)
            kernel, experiment = self._kernel(key, block.level), experiments[test]
            table = self._table(key, kernel, experiment, block, used)
            steps, kept = block.level.steps, len(block.rows)
            code = kernel.code(table.refined or self._one_loop, block.lanes, experiment.samples * steps)
            if reduce:
                data, of = (data, of) if test == of else (experiment.packed(), test)
                result = np.empty((shape.sums, block.lanes))
            else:
                result = room((experiment.samples, shape.columns, shape.outputs, kept), block.lanes)
            ends = [(test, block.rows, slice(None))]
            yield Job(experiment.samples, steps, block.parameters, table, code.entry, data, result, kept, ends)

    def _run(self, wanted: Iterable[Job]) -> Iterator[tuple[int, NDArray[np.intp], FloatArray]]:
        """Test, parameter sets and result of every job: (sums, L) or (samples, 1 + nf, outputs, sets).

        So many at once as memory allows.
        """
        jobs, load, seen = list[Job](), 0, set[int]()
        for job in wanted:
            jobs.append(job)
            load += job.result.nbytes
            for shared in (job.table, job.data):
                load += 0 if shared is None or id(shared) in seen else shared.nbytes
                seen.add(id(shared))
            if load > _AT_ONCE_BYTES:
                yield from self._done(jobs)
                jobs, load, seen = [], 0, set()
        yield from self._done(jobs)

    def _done(self, jobs: Sequence[Job]) -> Iterator[tuple[int, NDArray[np.intp], FloatArray]]:
        """The results of jobs that run together."""
        entries: dict[int, list[Job]] = {}
        for job in jobs:
            entries.setdefault(id(job.entry), []).append(job)
        for members in entries.values():
            # the longest first, so that threads end together
            members.sort(key=lambda job: -job.samples * job.steps)
            records = np.array([job.record for job in members], dtype=np.int64).reshape(-1, len(JOB_FIELDS))
            self._call(members[0].entry, records)
        for job in jobs:
            for test, rows, place in job.ends:
                yield test, rows, job.result[..., place]

    def _call(self, entry: Callable[..., None], records: NDArray[np.int64]) -> None:
        """Run jobs in this thread and in as many others as there is work for."""
        counter = ctypes.c_int64(0)
        arguments = (records.ctypes.data, len(records), ctypes.addressof(counter))
        helpers: list[Future[None]] = []
        if (count := min(threads(self.jobs), len(records)) - 1) > 0:
            pool = _threads(os.getpid(), self.jobs - 1)
            helpers = [pool.submit(entry, *arguments) for _ in range(count)]
        entry(*arguments)
        for helper in helpers:
            if not helper.cancel():  # one that has not begun by now finds nothing left to do
                helper.result()
