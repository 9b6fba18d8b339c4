"""A CasADi SX function as a list of operations, prepared for the machine.

Every node has a level: what its value depends on. Values that are equal in all lanes (parameter sets) are computed once
per test, into a table; values that are constant in time are computed once per job.
"""

from __future__ import annotations

import marshal
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any, NamedTuple

import casadi as ca

#: of `marshal`: later ones write equal values differently
MARSHAL_FORMAT = 2

#: bits of a level: the value changes over time, from lane to lane
TIME, LANE = 1, 2

#: operations beyond CasADi's own: a*b + c, a*b - c, c - a*b, each rounded once
FMA, FMS, FNMA = 1000, 1001, 1002

_BOOLEAN = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR}
_COMMUTATIVE = {ca.OP_ADD, ca.OP_MUL, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_HYPOT}
_PRODUCTS = {ca.OP_MUL, ca.OP_SQ, ca.OP_TWICE}


class Node(NamedTuple):
    """One operation: CasADi's code (or FMA, FMS, FNMA), its operands and, for leaves, what they are."""

    op: int
    args: tuple[int, ...] = ()
    value: float | tuple[int, int] | None = None  # a constant, or (input, element)


@dataclass(frozen=True, eq=False)
class Program:
    """Nodes in order of evaluation and, per output, the node of each element."""

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[int, ...], ...]

    def __hash__(self) -> int:
        return hash(self.serialized)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Program) and self.serialized == other.serialized

    def __getattr__(self, name: str) -> Any:
        # of a program from its bytes: where its code is kept, nobody asks
        if name not in ("nodes", "outputs") or "serialized" not in vars(self):
            raise AttributeError(name)
        nodes, outputs = marshal.loads(self.serialized)
        vars(self).update(nodes=tuple(Node(*node) for node in nodes), outputs=outputs)
        return vars(self)[name]

    @cached_property
    def serialized(self) -> bytes:
        """The program as bytes, the same for equal programs."""
        return marshal.dumps(([tuple(node) for node in self.nodes], self.outputs), MARSHAL_FORMAT)

    @classmethod
    def deserialized(cls, content: bytes) -> Program:
        """The program from its bytes."""
        found = cls.__new__(cls)
        vars(found)["serialized"] = content
        return found

    @cached_property
    def digest(self) -> str:
        """Hash of the bytes."""
        return sha256(self.serialized).hexdigest()

    def levels(self, inputs: Sequence[int]) -> list[int]:
        """Level of every node from the level of every input."""
        found: list[int] = []
        for node in self.nodes:
            level = inputs[node.value[0]] if isinstance(node.value, tuple) else 0
            for arg in node.args:
                level |= found[arg]
            found.append(level)
        return found

    @cached_property
    def inputs(self) -> frozenset[int]:
        """Inputs that the outputs depend on, by number."""
        needed = self.needed(index for output in self.outputs for index in output)
        return frozenset(value[0] for index in needed if isinstance(value := self.nodes[index].value, tuple))

    def needed(self, roots: Iterable[int], known: Collection[int] = ()) -> list[int]:
        """The nodes to evaluate, in order, for the values of ``roots`` where those of ``known`` are there."""
        marked = set(roots).difference(known)
        for index in range(len(self.nodes) - 1, -1, -1):
            if index in marked:
                marked.update(arg for arg in self.nodes[index].args if arg not in known)
        return sorted(marked)


class _Builder:
    """Nodes without duplicates: equal operations on equal operands are one node."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[object, int] = {}

    def add(self, op: int, args: tuple[int, ...] = (), value: float | tuple[int, int] | None = None) -> int:
        if op in _COMMUTATIVE:
            args = tuple(sorted(args))
        # repr distinguishes -0.0 from 0.0 and makes nan equal to itself
        key = (op, args) if value is None else (op, args, repr(value))
        found = self._known.setdefault(key, len(self.nodes))
        if found == len(self.nodes):
            self.nodes.append(Node(op, args, value))
        return found

    def power(self, base: int, exponent: int) -> int:
        """A whole power by repeated squaring."""
        if exponent == 1:
            return base
        half = self.add(ca.OP_SQ, (self.power(base, exponent // 2),))
        return half if exponent % 2 == 0 else self.add(ca.OP_MUL, (half, base))


def trace(function: ca.Function) -> Program:
    """Read the instruction list of an SX function whose outputs are dense.

    A product with a truth value becomes a selection, as CasADi's derivative of ``if_else``
    multiplies by it: the branch not taken may then be infinite or nan.
    """
    build = _Builder()
    work: dict[int, int] = {}
    outputs = [[-1] * function.nnz_out(i) for i in range(function.n_out())]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        read, written = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            outputs[written[0]][written[1]] = work[read[0]]
        elif op == ca.OP_INPUT:
            work[written[0]] = build.add(op, value=(read[0], read[1]))
        elif op == ca.OP_CONST:
            work[written[0]] = build.add(op, value=function.instruction_constant(k))
        else:
            work[written[0]] = _traced(build, op, tuple(work[i] for i in read))
    return Program(tuple(build.nodes), tuple(map(tuple, outputs)))


def _traced(build: _Builder, op: int, args: tuple[int, ...]) -> int:
    if op in (ca.OP_ASSIGN, ca.OP_LIFT, ca.OP_PRINTME):
        return args[0]
    if op == ca.OP_MUL:
        for condition, other in (args, args[::-1]):
            if build.nodes[condition].op in _BOOLEAN:
                return build.add(ca.OP_IF_ELSE_ZERO, (condition, other))
    if op in (ca.OP_CONSTPOW, ca.OP_POW):
        exponent = build.nodes[args[1]].value
        if isinstance(exponent, float) and exponent.is_integer() and 2 <= exponent <= 16:
            return build.power(args[0], int(exponent))
    return build.add(op, args)


def contract(program: Program, inputs: Sequence[int]) -> Program:
    """Rewrite for speed; the result depends on the graph and on ``inputs`` (levels) alone.

    - ``a / b`` becomes ``a * (1 / b)`` where ``b`` divides more than once or changes less often than ``a``;
    - a product that is added or subtracted becomes a fused multiply-add.

    Doing both here, not in the compiler, makes results the same for any number of lanes.
    """
    return _fuse(_reciprocals(program, inputs), inputs)


def _rewrite(program: Program, rule: Callable[[_Builder, int, Node, list[int]], int]) -> Program:
    """A new program from ``rule(builder, old index, old node, map of old to new)``; dead nodes are dropped."""
    live = program.needed(index for group in program.outputs for index in group)
    build, new = _Builder(), [-1] * len(program.nodes)
    for index in live:
        new[index] = rule(build, index, program.nodes[index], new)
    return Program(tuple(build.nodes), tuple(tuple(new[i] for i in group) for group in program.outputs))


def pruned(program: Program) -> Program:
    """Without nodes that no output needs."""
    return _rewrite(program, _copied)


def _reciprocals(program: Program, inputs: Sequence[int]) -> Program:
    levels = program.levels(inputs)
    times: dict[int, int] = {}
    for node in program.nodes:
        if node.op == ca.OP_DIV:
            times[node.args[1]] = times.get(node.args[1], 0) + 1

    def rule(build: _Builder, index: int, node: Node, new: list[int]) -> int:
        args = tuple(new[i] for i in node.args)
        if node.op == ca.OP_DIV and (times[node.args[1]] > 1 or levels[node.args[1]] != levels[index]):
            return build.add(ca.OP_MUL, (args[0], build.add(ca.OP_INV, (args[1],))))
        return _copied(build, index, node, new)

    return _rewrite(program, rule)


def _fuse(program: Program, inputs: Sequence[int]) -> Program:
    levels = program.levels(inputs)
    uses = [0] * len(program.nodes)
    for node in program.nodes:
        for arg in node.args:
            uses[arg] += 1

    def rule(build: _Builder, index: int, node: Node, new: list[int]) -> int:
        if node.op in (ca.OP_ADD, ca.OP_SUB):
            # a product that is computed outside the loop is cheaper left alone
            found = [
                side
                for side in (0, 1)
                if program.nodes[node.args[side]].op in _PRODUCTS and levels[node.args[side]] == levels[index]
            ]
            if found:
                side = min(found, key=lambda side: uses[node.args[side]])
                product, other = program.nodes[node.args[side]], new[node.args[1 - side]]
                factors = tuple(new[i] for i in product.args)
                if product.op == ca.OP_SQ:
                    factors = factors * 2
                elif product.op == ca.OP_TWICE:
                    factors = (*factors, build.add(ca.OP_CONST, value=2.0))
                op = FMA if node.op == ca.OP_ADD else (FMS, FNMA)[side]
                return build.add(op, (*factors, other))
        return _copied(build, index, node, new)

    # products that all went into sums are dead now
    return pruned(_rewrite(program, rule))


def _copied(build: _Builder, _: int, node: Node, new: list[int]) -> int:
    return build.add(node.op, tuple([new[i] for i in node.args]), node.value)
