"""The time loop of a kernel as machine code: a block of parameter sets through one test per job."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

from casadi import OP_CONST

from mofit.simulation.compiler.emit import Emitter
from mofit.simulation.compiler.instructions import F64, I64, PTR, Value, double, integer
from mofit.simulation.compiler.machine import Code, compile_entry, host
from mofit.simulation.compiler.program import LANE
from mofit.simulation.compiler.split import Split

#: what a job gives to the loop, eight bytes each, in this order
JOB_FIELDS = (
    "samples",  # number of samples
    "parameters",  # the free ones, then all others, (np, L)
    "constant",  # table row of values that are constant in time
    "rows",  # table of values at every sample
    "data",  # per sample: flag (0: no output has a weight), measured, weights
    "counts",  # integrator steps per sample (refined loops only)
    "substep_rows",  # table of values at every further step (refined loops only)
    "result",  # where the result goes
    "kept",  # lanes whose outputs are stored, the first ones (loops that store only)
)
_FIELD = {name: index for index, name in enumerate(JOB_FIELDS)}
#: places of the state and of the parameters that are not free among `integrators.GRAPH_INPUTS`
STATE, FIXED = 1, 5

Values = dict[int, Value]
Step = Callable[[Value, list[Value], Value], tuple[list[Value], Value]]
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p)


@dataclass(frozen=True)
class Shape:
    """Sizes of a loop."""

    states: int
    outputs: int
    free: int
    derivatives: bool

    @property
    def columns(self) -> int:
        """A value and its derivatives."""
        return 1 + self.free * self.derivatives

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Rows and columns of the upper triangle of the Gauss-Newton Hessian."""
        return [(i, j) for i in range(self.free) for j in range(i, self.free)]

    @property
    def terms(self) -> int:
        """Numbers that a reducing loop sums of one output: cost, gradient, upper triangle."""
        return 1 + (self.free + len(self.pairs)) * self.derivatives

    @property
    def sums(self) -> int:
        """Numbers that a reducing loop gives: the terms of every output in turn."""
        return self.outputs * self.terms


@lru_cache(maxsize=256)
def compile_loop(
    sample: Split,
    substep: Split | None,
    shape: Shape,
    reduce: bool,
    lanes: int,
    own_tables: bool = False,
    *,
    quick: bool = False,
) -> Code:
    """Compile ``run(jobs, number of jobs, counter)``, see `compile_entry`.

    Threads that share a counter share the jobs. Job after job, sample after sample: outputs, then one step by
    ``sample``, then further steps by ``substep`` if the loop is refined. With ``reduce`` the loop sums weighted
    squares, else it stores the outputs of every sample. With ``own_tables`` every lane has a table of its own, a vector
    for every value that lanes else share.
    """
    what = ("loop", sample.digest, substep and substep.digest, shape, reduce, lanes, own_tables)
    loop = partial(_Loop, sample, substep, shape, reduce, lanes, own_tables)
    return compile_entry(what, lambda: loop().text(), _SIGNATURE, quick=quick)


class _Loop:
    def __init__(
        self, sample: Split, substep: Split | None, shape: Shape, reduce: bool, lanes: int, own_tables: bool
    ) -> None:
        self.sample, self.substep, self.shape, self.reduce, self.lanes = sample, substep, shape, reduce, lanes
        self.own_tables = own_tables
        self.emit = Emitter([PTR, I64, PTR], lanes, host())
        self.build = self.emit.builder

    def text(self) -> str:
        """The module."""
        build, (jobs, count, counter) = self.build, self.emit.arguments
        fetch, work, done = self.emit.blocks(3)
        build.branch(fetch)
        build.position_at_end(fetch)
        index = build.fetch_and_add(counter, integer(1))
        build.cbranch(build.less(index, count), work, done)
        build.position_at_end(work)
        self._job(build.gep(jobs, self.emit.times(index, len(JOB_FIELDS)), I64))
        build.branch(fetch)
        build.position_at_end(done)
        return self.emit.text()

    def _field(self, job: Value, name: str, kind: str = PTR) -> Value:
        place = self.build.gep(job, integer(_FIELD[name]), I64)
        return self.build.load(place, kind)

    def _job(self, job: Value) -> None:
        samples = self._field(job, "samples", I64)
        parameters, constant, rows, data, result = (
            self._field(job, name) for name in ("parameters", "constant", "rows", "data", "result")
        )
        invariant = self._invariant(self.sample, parameters, constant, 0)
        initial = [invariant[index] for index in self.sample.program.outputs[0]]
        kept = self._field(job, "kept", I64)
        sums = [self.emit.constant(0.0)] * (self.shape.sums * self.reduce)
        step = self._refinement(job, parameters, constant) if self.substep else None

        def body(k: Value, carried: list[Value]) -> list[Value]:
            state, rest = carried[: len(initial)], carried[len(initial) :]
            values = self._at(self.sample, invariant, state, rows, k)
            ends = self._outputs(self.sample, 1, values)
            if self.reduce:
                rest[: len(sums)] = self._accumulated(values, rest[: len(sums)], data, k)
            else:
                self._stored(values, result, kept, k)
            if step:
                ends, rest[len(sums)] = step(k, ends, rest[len(sums)])
            return ends + rest

        row = [integer(0)] * bool(step)
        final = self.emit.loop(samples, initial + sums + row, body)
        for number, value in enumerate(final[len(initial) : len(initial) + len(sums)]):
            self.emit.store(value, result, number * self.lanes)

    def _refinement(self, job: Value, parameters: Value, constant: Value) -> Step:
        """Takes the state through the further steps of a sample, and on to the next rows of their table."""
        split = self.substep
        assert split is not None
        invariant = self._invariant(split, parameters, constant, len(self.sample.constant))
        counts, rows = self._field(job, "counts"), self._field(job, "substep_rows")

        def step(k: Value, state: list[Value], row: Value) -> tuple[list[Value], Value]:
            count = self.build.load(self.build.gep(counts, k, I64), I64)

            def body(s: Value, now: list[Value]) -> list[Value]:
                return self._outputs(split, 1, self._at(split, invariant, now, rows, self.build.add(row, s)))

            return self.emit.loop(count, state, body), self.build.add(row, count)

        return step

    def _invariant(self, split: Split, parameters: Value, constant: Value, offset: int) -> Values:
        """Loop-invariant values: those of the table and what every lane computes from them once."""
        emit, nodes = self.emit, split.program.nodes
        values = {index: self._read(constant, integer(offset + i)) for i, index in enumerate(split.constant)}
        constants = {i for i in split.live if not nodes[i].args and nodes[i].op == OP_CONST}
        invariant = [i for i in split.live if split.levels[i] == LANE or i in constants]
        for index in invariant:
            source = nodes[index].value
            if isinstance(source, tuple):
                row = source[1] + (self.shape.free if source[0] == FIXED else 0)
                values[index] = emit.load(parameters, row * self.lanes)
        emit.program(split.program, invariant, values)
        return values

    def _at(self, split: Split, invariant: Values, state: list[Value], rows: Value, row: Value) -> Values:
        """Values at the start of a step: the invariant ones, the state and the row of the table, read when used."""
        values = dict(invariant)
        for index in split.live:
            source = split.program.nodes[index].value
            if isinstance(source, tuple) and source[0] == STATE:
                values[index] = state[source[1]]
        base = self.emit.times(row, len(split.varying))
        for place, index in enumerate(split.varying):
            values[index] = self._read(rows, self.build.add(base, integer(place)))
        return values

    def _read(self, table: Value, number: Value) -> Value:
        """A value of a table, the same in all lanes or of each its own."""
        if self.own_tables:
            return self.emit.load(table, self.emit.times(number, self.lanes))
        return self.emit.load_splat(table, number)

    def _outputs(self, split: Split, output: int, values: Values) -> list[Value]:
        wanted = split.program.outputs[output]
        self.emit.program(split.program, wanted, values)
        return [values[index] for index in wanted]

    def _stored(self, values: Values, result: Value, kept: Value, k: Value) -> None:
        """Store the outputs of sample ``k``, (1 + nf, ny, kept): lanes that only pad would take most of the memory.

        Vectors overlap: each is written over the lanes of the one before that are not kept.
        """
        build, outputs = self.build, self._outputs(self.sample, 2, values)
        base = self.emit.times(k, len(outputs))
        for number, value in enumerate(outputs):
            place = build.mul(build.add(base, integer(number)), kept)
            self.emit.store(value, result, place)

    def _accumulated(self, values: Values, sums: list[Value], data: Value, k: Value) -> list[Value]:
        """The sums with sample ``k`` added, unless no output of it has a weight."""
        build, ny = self.build, self.shape.outputs
        base = self.emit.times(k, 1 + 2 * ny)
        flag = build.load(self.emit.address(data, base), F64)
        before, (inside, after) = build.block, self.emit.blocks(2)
        build.cbranch(build.fcmp_ordered("!=", flag, double(0.0)), inside, after)
        build.position_at_end(inside)
        # on a copy: what is emitted in this branch must not be used outside it
        outputs = self._outputs(self.sample, 2, dict(values))
        added = []
        for y in range(ny):
            numbers = [self.emit.load_splat(data, build.add(base, integer(1 + y + part * ny))) for part in (0, 1)]
            own = sums[y * self.shape.terms : (y + 1) * self.shape.terms]
            added += self._weighted_squares(own, outputs[y::ny], *numbers)
        inside = build.block
        build.branch(after)
        build.position_at_end(after)
        merged = []
        for old, new in zip(sums, added, strict=True):
            phi = build.phi(self.emit.type)
            build.add_incoming(phi, old, before)
            build.add_incoming(phi, new, inside)
            merged.append(phi)
        return merged

    def _weighted_squares(self, sums: list[Value], values: list[Value], measured: Value, weight: Value) -> list[Value]:
        """The sums with w r^2, w r dy_i and w dy_i dy_j of one output added."""
        build, add = self.build, self.emit.multiply_add
        residual, slopes = build.fsub(values[0], measured), values[1:]
        weighted = build.fmul(weight, residual)
        terms = [(weighted, residual), *((weighted, slope) for slope in slopes)]
        scaled = [build.fmul(weight, slope) for slope in slopes]
        if slopes:
            terms += [(scaled[i], slopes[j]) for i, j in self.shape.pairs]
        return [add(a, b, total) for (a, b), total in zip(terms, sums, strict=True)]
