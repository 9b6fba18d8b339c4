"""Calls of CasADi functions inside equations, written out: lookup tables by ``ca.interpolant`` above all."""

from __future__ import annotations

import re
import struct

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError


def written_out(where: str, expression: ca.SX) -> ca.SX:
    """The expression with its calls of functions replaced by operations, of which alone machine code is made.

    Parameters
    ----------
    where
        Whose equations they are.
    expression
        A dense column.

    Raises
    ------
    InputError
        If a called function consists of more than operations and tables of ``ca.interpolant``.
    """
    new: dict[int, ca.SX] = {}
    waiting = [expression[i] for i in range(expression.numel())]
    while waiting:
        node = waiting[-1]
        operands = [node.dep(i) for i in range(node.n_dep())]
        missing = [operand for operand in operands if operand.element_hash() not in new]
        if missing:
            waiting += missing
            continue
        waiting.pop()
        arguments = [new[operand.element_hash()] for operand in operands]
        new[node.element_hash()] = _node(where, node, arguments)
    return ca.SX(ca.vertcat(*(new[expression[i].element_hash()] for i in range(expression.numel()))))


def _node(where: str, node: ca.SX, arguments: list[ca.SX]) -> ca.SX:
    if node.is_output():
        return arguments[0][node.which_output()]
    if node.n_dep() == 0:
        return node
    if node.is_call():
        return _call(where, node.which_function(), ca.vertcat(*arguments))
    if len(arguments) == 1:
        return ca.SX.unary(node.op(), arguments[0])
    return ca.SX.binary(node.op(), *arguments)


def _call(where: str, function: ca.Function, arguments: ca.SX) -> ca.SX:
    """All elements of all results of a function, whose arguments' elements are in one column."""
    kind = function.class_name()
    if kind == "LinearInterpolant":
        return _linear(function, arguments)
    if kind == "BSplineInterpolant":
        return _spline(function, arguments)
    try:
        if kind not in ("MXFunction", "SXFunction"):
            raise NotImplementedError(kind)
        results = function.expand().call(_split(function, arguments), True, False)
    except (NotImplementedError, RuntimeError) as error:
        message = f"the equations call a CasADi function that is no expression ({function.name()}, {kind})"
        cure = "Write a table as ca.interpolant or ca.pw_lin, anything else in operations"
        raise InputError.of(where, message, cure) from error
    return written_out(where, ca.vertcat(*(ca.vec(ca.densify(result)) for result in results)))


def _split(function: ca.Function, arguments: ca.SX) -> list[ca.SX]:
    ends = np.cumsum([0, *(function.nnz_in(i) for i in range(function.n_in()))]).tolist()
    return [ca.SX(function.sparsity_in(i), arguments[ends[i] : ends[i + 1]]) for i in range(function.n_in())]


def _linear(function: ca.Function, x: ca.SX) -> ca.SX:
    """Multilinear between the points of the grid, and on beyond them."""
    fields = _Fields(function)
    grids = fields.parts("Interpolant::grid", "Interpolant::offset")

    def hats(grid: FloatArray, x: ca.SX) -> ca.SX:
        return ca.vertcat(*(ca.pw_lin(x, grid, unit) for unit in np.eye(len(grid))))

    return _tensor(fields.reals("Interpolant::values"), [hats(grid, x[k]) for k, grid in enumerate(grids)])


def _spline(function: ca.Function, x: ca.SX) -> ca.SX:
    """Tensor product of B-splines; zero outside of the grid, as in CasADi."""
    fields = _Fields(function)
    knots, degrees = (
        fields.parts("BSplineCommon::knots", "BSplineCommon::offset"),
        fields.integers("BSplineCommon::degree"),
    )
    bases = [_basis(t, degree, x[k]) for k, (t, degree) in enumerate(zip(knots, degrees, strict=True))]
    return _tensor(fields.reals("BSpline::coeffs"), bases)


def _basis(t: FloatArray, degree: int, x: ca.SX) -> ca.SX:
    """B-splines of knots ``t`` at ``x``, by the recursion of Cox and de Boor."""
    last = int(np.flatnonzero(np.diff(t) > 0)[-1])
    basis = [
        ca.logic_and(x >= t[i], x <= t[i + 1] if i == last else x < t[i + 1]) if t[i] < t[i + 1] else ca.SX(0)
        for i in range(len(t) - 1)
    ]
    for k in range(1, degree + 1):
        rising = [(x - t[i]) / (t[i + k] - t[i]) if t[i + k] > t[i] else 0 for i in range(len(t) - k)]
        basis = [rising[i] * basis[i] + (1 - rising[i + 1]) * basis[i + 1] for i in range(len(basis) - 1)]
    return ca.SX(ca.vertcat(*basis))


def _tensor(values: FloatArray, bases: list[ca.SX]) -> ca.SX:
    """Sum over the grid of values times the product of the bases; of the values, the first index runs fastest."""
    left = ca.SX(ca.DM(values))
    for basis in reversed(bases):
        left = ca.reshape(left, left.numel() // basis.numel(), basis.numel()) @ basis
    return ca.SX(left)


class _Fields:
    """Named fields of a serialised function: CasADi shows the contents of a table in no other way."""

    def __init__(self, function: ca.Function) -> None:
        half = np.frombuffer(function.serialize({"debug": True}).encode(), dtype=np.uint8) - ord("a")
        self._data = (half[0::2] | half[1::2] << 4).tobytes()

    def reals(self, name: str) -> FloatArray:
        """A vector of numbers."""
        return np.array(self._vector(name, "d"))

    def integers(self, name: str) -> list[int]:
        """A vector of whole numbers."""
        return [int(value) for value in self._vector(name, "q")]

    def parts(self, name: str, offset: str) -> list[FloatArray]:
        """A vector cut at offsets."""
        return np.split(self.reals(name), self.integers(offset)[1:-1])

    def _vector(self, name: str, kind: str) -> list[float]:
        found = re.search(re.escape(name.encode()) + b"VJ", self._data)
        if found is None:
            raise KeyError(name)  # another CasADi than those tested
        (count,) = struct.unpack_from("<q", self._data, found.end())
        begin = found.end() + 8
        return [struct.unpack_from(f"<{kind}", self._data, begin + 9 * i + 1)[0] for i in range(count)]
