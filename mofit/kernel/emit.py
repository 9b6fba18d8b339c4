"""One node of a program as LLVM instructions on vectors of lanes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import casadi as ca
from llvmlite import ir

from mofit.kernel.program import FMA, FMS, FNMA, Node, Program

F64, I64, PTR = ir.DoubleType(), ir.IntType(64), ir.PointerType()

#: operations that call the C mathematics library lane by lane
LIBM = {
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_SIN: "sin", ca.OP_COS: "cos",
    ca.OP_TAN: "tan", ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_FMOD: "fmod",
    ca.OP_ERF: "erf", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_TANH: "tanh", ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh", ca.OP_ATAN2: "atan2", ca.OP_LOG1P: "log1p", ca.OP_EXPM1: "expm1",
    ca.OP_HYPOT: "hypot", ca.OP_REMAINDER: "remainder",
}  # fmt: skip
LIBM_NAMES = tuple(sorted(set(LIBM.values())))
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "=="}
_INTRINSIC = {
    ca.OP_SQRT: "sqrt", ca.OP_FABS: "fabs", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_COPYSIGN: "copysign",
    ca.OP_FMIN: "minnum", ca.OP_FMAX: "maxnum",
}  # fmt: skip


class Emitter:
    """Emits nodes into the block that ``builder`` stands in.

    Parameters
    ----------
    module, builder
        Where the code goes.
    lanes
        Number of parameter sets in a vector.
    fma
        Whether the host rounds a multiply-add once; if not, it is a product and a sum.
    """

    def __init__(self, module: ir.Module, builder: ir.IRBuilder, lanes: int, fma: bool) -> None:
        self.module, self.builder, self.lanes, self.fma = module, builder, lanes, fma
        self.type = ir.VectorType(F64, lanes)
        self._truth: dict[ir.Value, ir.Value] = {}  # a truth value as a mask, by its 0/1 form

    def constant(self, value: float) -> ir.Constant:
        """The same number in every lane."""
        return ir.Constant(self.type, [ir.Constant(F64, value)] * self.lanes)

    def splat(self, scalar: ir.Value) -> ir.Value:
        """A scalar spread over the lanes."""
        one = self.builder.insert_element(ir.Constant(self.type, ir.Undefined), scalar, ir.Constant(I64, 0))
        mask = ir.Constant(ir.VectorType(ir.IntType(32), self.lanes), [0] * self.lanes)
        return self.builder.shuffle_vector(one, ir.Constant(self.type, ir.Undefined), mask)

    def address(self, base: ir.Value, index: int | ir.Value) -> ir.Value:
        """Address of the double number ``index`` after ``base``."""
        place = index if isinstance(index, ir.Value) else ir.Constant(I64, index)
        return self.builder.gep(base, [place], source_etype=F64)

    def load(self, base: ir.Value, index: int | ir.Value) -> ir.Value:
        """A vector whose first double is number ``index`` after ``base``."""
        return self.builder.load(self.address(base, index), typ=self.type, align=8)

    def load_splat(self, base: ir.Value, index: int | ir.Value) -> ir.Value:
        """One double from memory, spread over the lanes."""
        return self.splat(self.builder.load(self.address(base, index), typ=F64, align=8))

    def store(self, value: ir.Value, base: ir.Value, index: int | ir.Value) -> None:
        """Store a vector from double number ``index`` after ``base``."""
        self.builder.store(value, self.address(base, index), align=8)

    def multiply_add(self, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
        """``a * b + c``."""
        if self.fma:
            return self._intrinsic("fma", a, b, c)
        return self.builder.fadd(self.builder.fmul(a, b), c)

    def program(self, program: Program, roots: Iterable[int], values: dict[int, ir.Value]) -> None:
        """Emit what ``roots`` need beyond ``values``, adding it to them."""
        for index in program.needed(roots, values):
            node = program.nodes[index]
            values[index] = self.node(node, [values[i] for i in node.args])

    def node(self, node: Node, args: list[ir.Value]) -> ir.Value:
        """One operation other than an input."""
        op, build = node.op, self.builder
        if op == ca.OP_CONST:
            assert isinstance(node.value, float)
            return self.constant(node.value)
        if op in _COMPARE:
            return self._number(build.fcmp_ordered(_COMPARE[op], *args))
        if op in _INTRINSIC:
            return self._intrinsic(_INTRINSIC[op], *args)
        if op in LIBM:
            return self._per_lane(LIBM[op], *args)
        return _RULES[op](self, *args)

    def _number(self, mask: ir.Value) -> ir.Value:
        number = self.builder.select(mask, self.constant(1.0), self.constant(0.0))
        self._truth[number] = mask
        return number

    def _mask(self, value: ir.Value) -> ir.Value:
        """True where a number is not zero, nan included, as in C."""
        if value in self._truth:
            return self._truth[value]
        return self.builder.fcmp_unordered("!=", value, self.constant(0.0))

    def _intrinsic(self, name: str, *args: ir.Value) -> ir.Value:
        return self.builder.call(self._declare(f"llvm.{name}.v{self.lanes}f64", self.type, len(args)), args)

    def _declare(self, name: str, kind: ir.Type, count: int) -> ir.Function:
        if name in self.module.globals:
            return self.module.globals[name]
        return ir.Function(self.module, ir.FunctionType(kind, [kind] * count), name)

    def _per_lane(self, name: str, *args: ir.Value) -> ir.Value:
        function = self._declare(f"libm_{name}", F64, len(args))
        result = ir.Constant(self.type, ir.Undefined)
        for lane in range(self.lanes):
            place = ir.Constant(I64, lane)
            scalar = self.builder.call(function, [self.builder.extract_element(arg, place) for arg in args])
            result = self.builder.insert_element(result, scalar, place)
        return result

    def _sign(self, x: ir.Value) -> ir.Value:
        """-1, 1, or x itself where it is zero or nan."""
        zero = self.constant(0.0)
        positive = self.builder.select(self.builder.fcmp_ordered(">", x, zero), self.constant(1.0), x)
        return self.builder.select(self.builder.fcmp_ordered("<", x, zero), self.constant(-1.0), positive)

    def _erfinv(self, x: ir.Value) -> ir.Value:
        """Inverse error function: rational start (Giles' split of the range) and two Newton steps, as CasADi does."""
        build = self.builder

        def polynomial(at: ir.Value, coefficients: tuple[float, ...]) -> ir.Value:
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
        tail = self._intrinsic("sqrt", build.fneg(self._per_lane("log", half)))
        outer = build.fdiv(
            polynomial(tail, (-1.970840454, -1.62490649, 3.429567803, 1.641345311)),
            polynomial(tail, (1.0, 3.543889200, 1.637067800)),
        )
        inner = build.fcmp_ordered("<=", size, self.constant(0.7))
        z = build.select(inner, central, self._intrinsic("copysign", outer, x))
        for _ in range(2):
            slope = build.fmul(
                self.constant(2.0 / math.sqrt(math.pi)), self._per_lane("exp", build.fneg(build.fmul(z, z)))
            )
            z = build.fsub(z, build.fdiv(build.fsub(self._per_lane("erf", z), x), slope))
        edge = build.fcmp_ordered(">=", size, self.constant(1.0))
        beyond = build.fcmp_ordered(">", size, self.constant(1.0))
        infinite = self._intrinsic("copysign", self.constant(math.inf), x)
        return build.select(beyond, self.constant(math.nan), build.select(edge, infinite, z))


_RULES: dict[int, Callable[..., ir.Value]] = {
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

#: every operation that a program may hold
OPERATIONS = frozenset([*_RULES, *_COMPARE, *_INTRINSIC, *LIBM, ca.OP_CONST, ca.OP_INPUT])
