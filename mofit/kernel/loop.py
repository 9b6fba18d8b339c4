"""The time loop of one variant as machine code: a block of parameter sets through one test per job."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

from casadi import OP_CONST, CasadiMeta
from llvmlite import ir

from mofit.kernel.emit import F64, I64, LIBM_NAMES, PTR, Emitter
from mofit.kernel.evaluate import module_text, new_function
from mofit.kernel.machine import Code, compile_entry, host
from mofit.kernel.program import LANE, TIME, Program

#: what a job hands to the loop, eight bytes each, in this order
JOB_FIELDS = (
    "samples",  # number of samples
    "lanes",  # free, then all other parameters, (np, L)
    "constant",  # table row of values that time does not touch
    "rows",  # table of values at every sample
    "data",  # per sample: flag (0: no output is weighed), measured, weights
    "counts",  # integrator steps per sample (refined loops only)
    "substep_rows",  # table of values at every further step (refined loops only)
    "result",  # where the result goes
)
_FIELD = {name: index for index, name in enumerate(JOB_FIELDS)}
#: which inputs of a graph are the state and the parameters without derivatives
STATE, FIXED = 1, 5

Values = dict[int, ir.Value]
Body = Callable[[ir.Value, list[ir.Value]], list[ir.Value]]
Step = Callable[[ir.Value, list[ir.Value], ir.Value], tuple[list[ir.Value], ir.Value]]
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p)


@dataclass(frozen=True)
class Split:
    """A graph (see `steps.build_graph`) cut into what a table holds and what every lane works out.

    Parameters
    ----------
    program
        All of it.
    inputs
        Level of every input.
    outputs
        Which outputs are wanted.
    """

    program: Program
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]

    @cached_property
    def levels(self) -> list[int]:
        """Level of every node."""
        return self.program.levels(self.inputs)

    @cached_property
    def roots(self) -> tuple[int, ...]:
        """Nodes of the wanted outputs."""
        return tuple(index for output in self.outputs for index in self.program.outputs[output])

    @cached_property
    def live(self) -> list[int]:
        """Nodes that the wanted outputs depend on."""
        return self.program.needed(self.roots)

    def _frontier(self, level: int) -> tuple[int, ...]:
        nodes, levels = self.program.nodes, self.levels
        read = {arg for index in self.live if levels[index] & LANE for arg in nodes[index].args} | set(self.roots)
        constant = {index for index in read if not nodes[index].args and isinstance(nodes[index].value, float)}
        return tuple(sorted(index for index in read - constant if levels[index] == level))

    @cached_property
    def constant(self) -> tuple[int, ...]:
        """Nodes whose values the lanes read once."""
        return self._frontier(0)

    @cached_property
    def varying(self) -> tuple[int, ...]:
        """Nodes whose values the lanes read at every step."""
        return self._frontier(TIME)

    @cached_property
    def table(self) -> Program:
        """Works out `constant` and `varying`, from the graph's inputs."""
        return Program(self.program.nodes, (self.constant + self.varying,))


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
    def normal(self) -> list[tuple[int, int]]:
        """Rows and columns of the upper triangle of the Gauss-Newton matrix."""
        return [(i, j) for i in range(self.free) for j in range(i, self.free)]

    @property
    def sums(self) -> int:
        """Numbers that a reducing loop gives: cost, gradient, upper triangle."""
        return 1 + (self.free + len(self.normal)) * self.derivatives


@lru_cache(maxsize=256)
def compile_loop(sample: Split, substep: Split | None, shape: Shape, reduce: bool, lanes: int) -> Code:
    """Compile ``run(jobs, number of jobs, counter)``.

    Threads that share a counter share the jobs. Job after job, sample after sample: outputs, then
    one step by ``sample``, then further steps by ``substep`` if the loop is refined. A reducing
    loop sums weighted squares, another stores the outputs of every sample.
    """
    what = ("loop", CasadiMeta.version(), sample, substep, shape, reduce, lanes)
    return compile_entry(what, lambda: _Loop(sample, substep, shape, reduce, lanes).text(), LIBM_NAMES, _SIGNATURE)


class _Loop:
    def __init__(self, sample: Split, substep: Split | None, shape: Shape, reduce: bool, lanes: int) -> None:
        self.sample, self.substep, self.shape, self.reduce, self.lanes = sample, substep, shape, reduce, lanes
        self.module, self.run, self.build = new_function("run", [PTR, I64, PTR])
        self.emitter = Emitter(self.module, self.build, lanes, host().fma)

    def text(self) -> str:
        """Emit the module."""
        build, (jobs, count, counter) = self.build, self.run.args
        fetch, work, done = (self.run.append_basic_block(name) for name in ("fetch", "work", "done"))
        build.branch(fetch)
        build.position_at_end(fetch)
        index = build.atomic_rmw("add", counter, ir.Constant(I64, 1), "monotonic")
        build.cbranch(build.icmp_signed("<", index, count), work, done)
        build.position_at_end(work)
        self._job(build.gep(jobs, [build.mul(index, ir.Constant(I64, len(JOB_FIELDS)))], source_etype=I64))
        build.branch(fetch)
        build.position_at_end(done)
        build.ret_void()
        return module_text(self.module)

    def _field(self, job: ir.Value, name: str, kind: ir.Type = PTR) -> ir.Value:
        place = self.build.gep(job, [ir.Constant(I64, _FIELD[name])], source_etype=I64)
        return self.build.load(place, typ=kind, align=8)

    def _counted(self, count: ir.Value, carried: list[ir.Value], body: Body) -> list[ir.Value]:
        """``for k in range(count): carried = body(k, carried)``."""
        build = self.build
        before, head, inside, after = build.block, *(self.run.append_basic_block() for _ in range(3))
        build.branch(head)
        build.position_at_end(head)
        k = build.phi(I64)
        now = [build.phi(value.type) for value in carried]
        build.cbranch(build.icmp_signed("<", k, count), inside, after)
        build.position_at_end(inside)
        following = [build.add(k, ir.Constant(I64, 1)), *body(k, now)]
        for phi, start, end in zip([k, *now], [ir.Constant(I64, 0), *carried], following, strict=True):
            phi.add_incoming(start, before)
            phi.add_incoming(end, build.block)
        build.branch(head)
        build.position_at_end(after)
        return now

    def _job(self, job: ir.Value) -> None:
        samples = self._field(job, "samples", I64)
        free, constant, rows, data, result = (
            self._field(job, name) for name in ("lanes", "constant", "rows", "data", "result")
        )
        steady = self._steady(self.sample, free, constant, 0)
        initial = [steady[index] for index in self.sample.program.outputs[0]]
        sums = [self.emitter.constant(0.0)] * (self.shape.sums * self.reduce)
        step = self._refinement(job, free, constant) if self.substep else None

        def body(k: ir.Value, carried: list[ir.Value]) -> list[ir.Value]:
            state, rest = carried[: len(initial)], carried[len(initial) :]
            values = self._at(self.sample, steady, state, rows, k)
            ends = self._outputs(self.sample, 1, values)
            if self.reduce:
                rest[: len(sums)] = self._weighed(values, rest[: len(sums)], data, k)
            else:
                self._stored(values, result, k)
            if step:
                ends, rest[len(sums)] = step(k, ends, rest[len(sums)])
            return ends + rest

        row = [ir.Constant(I64, 0)] * bool(step)
        final = self._counted(samples, initial + sums + row, body)
        for number, value in enumerate(final[len(initial) : len(initial) + len(sums)]):
            self.emitter.store(value, result, number * self.lanes)

    def _refinement(self, job: ir.Value, free: ir.Value, constant: ir.Value) -> Step:
        """What takes the state through the further steps of a sample, and on in their table."""
        split = self.substep
        assert split is not None
        steady = self._steady(split, free, constant, len(self.sample.constant))
        counts, rows = self._field(job, "counts"), self._field(job, "substep_rows")

        def step(k: ir.Value, state: list[ir.Value], row: ir.Value) -> tuple[list[ir.Value], ir.Value]:
            count = self.build.load(self.build.gep(counts, [k], source_etype=I64), typ=I64, align=8)

            def body(s: ir.Value, now: list[ir.Value]) -> list[ir.Value]:
                return self._outputs(split, 1, self._at(split, steady, now, rows, self.build.add(row, s)))

            return self._counted(count, state, body), self.build.add(row, count)

        return step

    def _steady(self, split: Split, free: ir.Value, constant: ir.Value, offset: int) -> Values:
        """Values that time does not touch."""
        emit, nodes = self.emitter, split.program.nodes
        values = {index: emit.load_splat(constant, offset + i) for i, index in enumerate(split.constant)}
        steady = [i for i in split.live if split.levels[i] == LANE or (not nodes[i].args and nodes[i].op == OP_CONST)]
        for index in steady:
            source = nodes[index].value
            if isinstance(source, tuple):
                row = source[1] + (self.shape.free if source[0] == FIXED else 0)
                values[index] = emit.load(free, row * self.lanes)
        emit.program(split.program, steady, values)
        return values

    def _at(self, split: Split, steady: Values, state: list[ir.Value], rows: ir.Value, row: ir.Value) -> Values:
        """Values at the start of a step: the steady ones, the state and the table's row, read when used."""
        values = dict(steady)
        for index in split.live:
            source = split.program.nodes[index].value
            if isinstance(source, tuple) and source[0] == STATE:
                values[index] = state[source[1]]
        base = self.build.mul(row, ir.Constant(I64, len(split.varying)))
        for place, index in enumerate(split.varying):
            values[index] = self.emitter.load_splat(rows, self.build.add(base, ir.Constant(I64, place)))
        return values

    def _outputs(self, split: Split, output: int, values: Values) -> list[ir.Value]:
        wanted = split.program.outputs[output]
        self.emitter.program(split.program, wanted, values)
        return [values[index] for index in wanted]

    def _stored(self, values: Values, result: ir.Value, k: ir.Value) -> None:
        """Store the outputs of sample ``k``: (ny, 1 + nf, L)."""
        outputs = self._outputs(self.sample, 2, values)
        base = self.build.mul(k, ir.Constant(I64, len(outputs) * self.lanes))
        for number, value in enumerate(outputs):
            self.emitter.store(value, result, self.build.add(base, ir.Constant(I64, number * self.lanes)))

    def _weighed(self, values: Values, sums: list[ir.Value], data: ir.Value, k: ir.Value) -> list[ir.Value]:
        """The sums with sample ``k`` added, unless no output of it has a weight."""
        build, ny = self.build, self.shape.outputs
        base = build.mul(k, ir.Constant(I64, 1 + 2 * ny))
        flag = build.load(self.emitter.address(data, base), typ=F64, align=8)
        before, inside, after = build.block, self.run.append_basic_block(), self.run.append_basic_block()
        build.cbranch(build.fcmp_ordered("!=", flag, ir.Constant(F64, 0.0)), inside, after)
        build.position_at_end(inside)
        # on a copy: what is emitted in this branch must not be used outside it
        outputs = self._outputs(self.sample, 2, dict(values))
        added = list(sums)
        for y in range(ny):
            numbers = [
                self.emitter.load_splat(data, build.add(base, ir.Constant(I64, 1 + y + part * ny))) for part in (0, 1)
            ]
            added = self._squares(added, outputs[y::ny], *numbers)
        inside = build.block
        build.branch(after)
        build.position_at_end(after)
        merged = []
        for old, new in zip(sums, added, strict=True):
            phi = build.phi(self.emitter.type)
            phi.add_incoming(old, before)
            phi.add_incoming(new, inside)
            merged.append(phi)
        return merged

    def _squares(
        self, sums: list[ir.Value], values: list[ir.Value], measured: ir.Value, weight: ir.Value
    ) -> list[ir.Value]:
        """Add w r^2, w r dy_i and w dy_i dy_j of one output."""
        build, add = self.build, self.emitter.multiply_add
        residual, slopes = build.fsub(values[0], measured), values[1:]
        weighted = build.fmul(weight, residual)
        terms = [(weighted, residual), *((weighted, slope) for slope in slopes)]
        scaled = [build.fmul(weight, slope) for slope in slopes]
        if slopes:
            terms += [(scaled[i], slopes[j]) for i, j in self.shape.normal]
        return [add(a, b, total) for (a, b), total in zip(terms, sums, strict=True)]
