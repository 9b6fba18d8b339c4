"""A program as LLVM instructions on vectors of lanes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import casadi as ca

from mofit.simulation.compiler.instructions import (
    F64,
    Block,
    Builder,
    Value,
    double,
    integer,
    together,
    undefined,
    vector,
)
from mofit.simulation.compiler.machine import LIBM, Host
from mofit.simulation.compiler.program import FMA, FMS, FNMA, Node, Program

_ATTRIBUTES = '{ nounwind "prefer-vector-width"="512" "min-legal-vector-width"="512" }'

#: operations that call the C mathematics library
_CALLS = {getattr(ca, f"OP_{name.upper()}"): name for name in LIBM} | {ca.OP_CONSTPOW: "pow"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "=="}
_INTRINSIC = {
    ca.OP_SQRT: "sqrt", ca.OP_FABS: "fabs", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_COPYSIGN: "copysign",
    ca.OP_FMIN: "minnum", ca.OP_FMAX: "maxnum",
}  # fmt: skip


#: ``(index, carried values) -> carried values``: the body of a loop
Body = Callable[[Value, list[Value]], list[Value]]


class Emitter:
    """Writes a module with one function ``run`` of ``arguments`` (their types), which returns nothing.

    A vector holds ``lanes`` parameter sets. Where the host has ``fma``, a multiply-add is rounded once; else it is a
    product and a sum.
    """

    def __init__(self, arguments: Sequence[str], lanes: int, host: Host) -> None:
        self.lanes, self.host = lanes, host
        self.builder, self.type = Builder(arguments), vector(F64, lanes)
        self.arguments = self.builder.arguments
        self._constants: dict[str, Value] = {}
        self._truth: dict[Value, Value] = {}  # a truth value as a mask, by its 0/1 form

    def text(self) -> str:
        """The module, its function ended here; it may use 512-bit registers."""
        self.builder.ret_void()
        return self.builder.text(_ATTRIBUTES)

    def blocks(self, count: int) -> list[Block]:
        """New blocks of the function."""
        return [self.builder.append_block() for _ in range(count)]

    def loop(self, count: Value, carried: list[Value], body: Body) -> list[Value]:
        """``for k in range(count): carried = body(k, carried)``."""
        build = self.builder
        before, (head, inside, after) = build.block, self.blocks(3)
        build.branch(head)
        build.position_at_end(head)
        k, now = build.phi(count.type), [build.phi(value.type) for value in carried]
        build.cbranch(build.less(k, count), inside, after)
        build.position_at_end(inside)
        following = [build.add(k, integer(1)), *body(k, now)]
        for phi, start, end in zip([k, *now], [integer(0), *carried], following, strict=True):
            build.add_incoming(phi, start, before)
            build.add_incoming(phi, end, build.block)
        build.branch(head)
        build.position_at_end(after)
        return now

    def times(self, value: Value, factor: int) -> Value:
        """A whole number times a constant one."""
        return self.builder.mul(value, integer(factor))

    def constant(self, value: float) -> Value:
        """The same number in every lane."""
        one = double(value)
        if one.text not in self._constants:
            self._constants[one.text] = together([one] * self.lanes)
        return self._constants[one.text]

    def splat(self, scalar: Value) -> Value:
        """A scalar in every lane."""
        return self.builder.shuffle(self.builder.insert_element(undefined(self.type), scalar, 0), [0] * self.lanes)

    def address(self, base: Value, index: int | Value) -> Value:
        """Address of the double number ``index`` after ``base``."""
        return self.builder.gep(base, integer(index) if isinstance(index, int) else index, F64)

    def load(self, base: Value, index: int | Value) -> Value:
        """A vector whose first double is number ``index`` after ``base``."""
        return self.builder.load(self.address(base, index), self.type)

    def load_splat(self, base: Value, index: int | Value) -> Value:
        """One double from memory, in every lane."""
        return self.splat(self.builder.load(self.address(base, index), F64))

    def store(self, value: Value, base: Value, index: int | Value) -> None:
        """Store a vector from double number ``index`` after ``base``."""
        self.builder.store(value, self.address(base, index))

    def multiply_add(self, a: Value, b: Value, c: Value) -> Value:
        """``a * b + c``."""
        if self.host.fma:
            return self._intrinsic("fma", a, b, c)
        return self.builder.fadd(self.builder.fmul(a, b), c)

    def program(self, program: Program, roots: Iterable[int], values: dict[int, Value]) -> None:
        """Emit what ``roots`` need beyond ``values``, adding it to them."""
        for index in program.needed(roots, values):
            node = program.nodes[index]
            values[index] = self.node(node, [values[i] for i in node.args])

    def node(self, node: Node, args: list[Value]) -> Value:
        """One operation other than an input."""
        op, build = node.op, self.builder
        if op == ca.OP_CONST:
            assert isinstance(node.value, float)
            return self.constant(node.value)
        if op in _COMPARE:
            return self._number(build.fcmp_ordered(_COMPARE[op], *args))
        if op in _INTRINSIC:
            return self._intrinsic(_INTRINSIC[op], *args)
        if op in _CALLS:
            return self._called(_CALLS[op], *args)
        return _RULES[op](self, *args)

    def _number(self, mask: Value) -> Value:
        number = self.builder.select(mask, self.constant(1.0), self.constant(0.0))
        self._truth[number] = mask
        return number

    def _mask(self, value: Value) -> Value:
        """True where a number is not zero, nan included, as in C."""
        if value in self._truth:
            return self._truth[value]
        return self.builder.fcmp_unordered("!=", value, self.constant(0.0))

    def _intrinsic(self, name: str, *args: Value) -> Value:
        return self.builder.call(f"llvm.{name}.v{self.lanes}f64", self.type, args)

    def _called(self, name: str, *args: Value) -> Value:
        """A function of the C mathematics library: of a register at a time where it can, else lane by lane."""
        if name not in self.host.libmvec:
            return self._per_lane(name, *args)
        width, result = self.host.width, undefined(self.type)
        for first in range(0, self.lanes, width):
            # fewer lanes than fill a register: the last is repeated
            taken = [min(first + place, self.lanes - 1) for place in range(width)]
            parts = [self.builder.shuffle(arg, taken) for arg in args]
            found = self.builder.call(f"libmvec_{name}", vector(F64, width), parts)
            for lane in range(first, min(first + width, self.lanes)):
                scalar = self.builder.extract_element(found, lane - first)
                result = self.builder.insert_element(result, scalar, lane)
        return result

    def _per_lane(self, name: str, *args: Value) -> Value:
        result = undefined(self.type)
        for lane in range(self.lanes):
            scalar = self.builder.call(f"libm_{name}", F64, [self.builder.extract_element(arg, lane) for arg in args])
            result = self.builder.insert_element(result, scalar, lane)
        return result

    def _sign(self, x: Value) -> Value:
        """-1, 1, or x itself where it is zero or nan."""
        zero = self.constant(0.0)
        positive = self.builder.select(self.builder.fcmp_ordered(">", x, zero), self.constant(1.0), x)
        return self.builder.select(self.builder.fcmp_ordered("<", x, zero), self.constant(-1.0), positive)

    def _erfinv(self, x: Value) -> Value:
        """Inverse error function: rational start (Giles' split of the range) and two Newton steps, as CasADi does."""
        build = self.builder

        def polynomial(at: Value, coefficients: tuple[float, ...]) -> Value:
            value = self.constant(coefficients[-1])
            for coefficient in coefficients[-2::-1]:
                value = build.fadd(build.fmul(value, at), self.constant(coefficient))
            return value

        square = build.fmul(x, x)
        central = build.fdiv(
            build.fmul(x, polynomial(square, (0.886226899, -1.645349621, 0.914624893, -0.140543331))),
            polynomial(square, (1.0, -2.118377725, 1.442710462, -0.329097515, 0.012229801)),
        )
        size = self._intrinsic("fabs", x)
        half = build.fmul(build.fsub(self.constant(1.0), size), self.constant(0.5))
        tail = self._intrinsic("sqrt", build.fneg(self._called("log", half)))
        outer = build.fdiv(
            polynomial(tail, (-1.970840454, -1.62490649, 3.429567803, 1.641345311)),
            polynomial(tail, (1.0, 3.543889200, 1.637067800)),
        )
        inner = build.fcmp_ordered("<=", size, self.constant(0.7))
        z = build.select(inner, central, self._intrinsic("copysign", outer, x))
        for _ in range(2):
            gauss = self._called("exp", build.fneg(build.fmul(z, z)))
            derivative = build.fmul(self.constant(2.0 / math.sqrt(math.pi)), gauss)
            z = build.fsub(z, build.fdiv(build.fsub(self._called("erf", z), x), derivative))
        edge = build.fcmp_ordered(">=", size, self.constant(1.0))
        beyond = build.fcmp_ordered(">", size, self.constant(1.0))
        infinite = self._intrinsic("copysign", self.constant(math.inf), x)
        return build.select(beyond, self.constant(math.nan), build.select(edge, infinite, z))


_RULES: dict[int, Callable[..., Value]] = {
    ca.OP_ADD: lambda e, a, b: e.builder.fadd(a, b),
    ca.OP_SUB: lambda e, a, b: e.builder.fsub(a, b),
    ca.OP_MUL: lambda e, a, b: e.builder.fmul(a, b),
    ca.OP_DIV: lambda e, a, b: e.builder.fdiv(a, b),
    ca.OP_INV: lambda e, a: e.builder.fdiv(e.constant(1.0), a),
    ca.OP_NEG: lambda e, a: e.builder.fneg(a),
    ca.OP_SQ: lambda e, a: e.builder.fmul(a, a),
    ca.OP_TWICE: lambda e, a: e.builder.fadd(a, a),
    FMA: lambda e, a, b, c: e.multiply_add(a, b, c),
    FMS: lambda e, a, b, c: e.multiply_add(a, b, e.builder.fneg(c)),
    FNMA: lambda e, a, b, c: e.multiply_add(e.builder.fneg(a), b, c),
    ca.OP_NE: lambda e, a, b: e._number(e.builder.fcmp_unordered("!=", a, b)),
    ca.OP_NOT: lambda e, a: e._number(e.builder.fcmp_ordered("==", a, e.constant(0.0))),
    ca.OP_AND: lambda e, a, b: e._number(e.builder.and_(e._mask(a), e._mask(b))),
    ca.OP_OR: lambda e, a, b: e._number(e.builder.or_(e._mask(a), e._mask(b))),
    ca.OP_IF_ELSE_ZERO: lambda e, a, b: e.builder.select(e._mask(a), b, e.constant(0.0)),
    ca.OP_SIGN: lambda e, a: e._sign(a),
    ca.OP_ERFINV: lambda e, a: e._erfinv(a),
}

#: every operation of a program
OPERATIONS = frozenset([*_RULES, *_COMPARE, *_INTRINSIC, *_CALLS, ca.OP_CONST, ca.OP_INPUT])
