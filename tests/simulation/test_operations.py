"""Every SX operation against CasADi's own evaluation, as vectors and as scalars."""

import casadi as ca
import numpy as np
import pytest
from scipy import special

from mofit.simulation.compiler.emit import OPERATIONS
from mofit.simulation.compiler.evaluate import evaluate
from mofit.simulation.compiler.program import FMA, FMS, FNMA, LANE, Node, Program, contract, trace

SPECIAL = [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 0.5, -0.5, 1e-300, -1e300, 2.0, 3.0, -2.5]

UNARY = {
    "neg": lambda x: -x, "sqrt": ca.sqrt, "sq": lambda x: x * x, "twice": lambda x: 2 * x, "inv": lambda x: 1 / x,
    "fabs": ca.fabs, "sign": ca.sign, "floor": ca.floor, "ceil": ca.ceil, "not": ca.logic_not, "exp": ca.exp,
    "log": ca.log, "log1p": ca.log1p, "expm1": ca.expm1, "sin": ca.sin, "cos": ca.cos, "tan": ca.tan, "asin": ca.asin,
    "acos": ca.acos, "atan": ca.atan, "sinh": ca.sinh, "cosh": ca.cosh, "tanh": ca.tanh, "asinh": ca.asinh,
    "acosh": ca.acosh, "atanh": ca.atanh, "erf": ca.erf,
    "constpow": lambda x: x**2.7, "square": lambda x: x**2, "cube": lambda x: x**3, "seventh": lambda x: x**7,
    "inverse power": lambda x: x**-1.5,
}  # fmt: skip
BINARY = {
    "add": lambda x, y: x + y, "sub": lambda x, y: x - y, "mul": lambda x, y: x * y, "div": lambda x, y: x / y,
    "lt": lambda x, y: x < y, "le": lambda x, y: x <= y, "eq": ca.eq, "ne": ca.ne, "and": ca.logic_and,
    "or": ca.logic_or, "fmin": ca.fmin, "fmax": ca.fmax, "fmod": ca.fmod, "remainder": ca.remainder,
    "copysign": ca.copysign, "pow": lambda x, y: x**y, "atan2": ca.atan2, "hypot": ca.hypot,
    "if_else": lambda x, y: ca.if_else(x > 0, y, -3.0),
    "if_else_zero": lambda x, y: ca.if_else(x, y, 0),
}  # fmt: skip


def assert_same(ours, theirs, ulps=4):
    """Equal, nan where nan, and within rounding of powers and libm elsewhere."""
    np.testing.assert_array_equal(np.isnan(ours), np.isnan(theirs))
    np.testing.assert_allclose(ours, theirs, rtol=ulps * np.finfo(float).eps, atol=0)


def evaluate_function(function, *points, lanes=8):
    return evaluate(trace(function), points, lanes)


def casadi_values(function, *points):
    return np.array(function.map(points[0].shape[-1])(*points))


@pytest.mark.parametrize("lanes", [1, 2, 8])
@pytest.mark.parametrize("name", UNARY)
def test_unary_operation(name, lanes, rng):
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [UNARY[name](x)])
    points = np.concatenate([SPECIAL, rng.normal(size=40), rng.uniform(-1, 1, 40), rng.normal(size=40) * 30])[None]
    ours, theirs = evaluate_function(function, points, lanes=lanes), casadi_values(function, points)
    assert_same(ours, theirs)
    zero = (theirs == 0) & (points == 0)
    np.testing.assert_array_equal(np.signbit(ours[zero]), np.signbit(theirs[zero]))


@pytest.mark.parametrize("name", UNARY)
def test_a_value_does_not_depend_on_its_neighbours(name, rng):
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [UNARY[name](x)])
    points = rng.permutation(np.concatenate([SPECIAL, rng.normal(size=18)]))[None]
    alone = [evaluate_function(function, points[:, [k]])[0, 0] for k in range(points.shape[1])]
    np.testing.assert_array_equal(evaluate_function(function, points)[0], alone)


@pytest.mark.parametrize("lanes", [1, 4])
@pytest.mark.parametrize("name", BINARY)
def test_binary_operation(name, lanes, rng):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [BINARY[name](x, y)])
    a, b = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    a, b = np.concatenate([a, rng.normal(size=40) * 5])[None], np.concatenate([b, rng.normal(size=40) * 5])[None]
    assert_same(evaluate_function(function, a, b, lanes=lanes), casadi_values(function, a, b))


def test_inverse_error_function():
    x = ca.SX.sym("x")
    points = np.array([[-2.0, -1.0, -0.9999, -0.8, -0.3, -1e-9, 0.0, 0.2, 0.7, 0.71, 0.999999, 1.0, 1.5, np.nan]])
    ours = evaluate_function(ca.Function("f", [x], [ca.erfinv(x)]), points)
    np.testing.assert_allclose(ours, special.erfinv(points), rtol=1e-11)


@pytest.mark.parametrize("op", sorted(OPERATIONS))
def test_every_operation_is_one_of_those_tested(op):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    functions = [ca.Function("f", [x], [f(x)]) for f in (*UNARY.values(), ca.erfinv)]
    functions += [ca.Function("f", [x, y], [f(x, y)]) for f in BINARY.values()]
    tested = {f.instruction_id(k) for f in functions for k in range(f.n_instructions())}
    assert op in tested | {FMA, FMS, FNMA}


def test_every_scalar_operation_of_casadi_is_known():
    scalar = set(range(ca.OP_ASSIGN, ca.OP_INPUT + 1)) | {ca.OP_ERFINV, ca.OP_LOG1P, ca.OP_EXPM1, ca.OP_HYPOT}
    left_to_the_trace = {ca.OP_ASSIGN}
    assert scalar - left_to_the_trace <= OPERATIONS


def test_inputs_of_a_program_are_those_that_its_outputs_need():
    inputs = tuple(Node(ca.OP_INPUT, (), (number, 0)) for number in range(3))
    program = Program((*inputs, Node(ca.OP_ADD, (0, 2)), Node(ca.OP_MUL, (0, 1))), ((3,),))
    assert program.inputs == {0, 2}


def test_fused_operations_round_once():
    a, b, c = 1 + 2.0**-30, 1 - 2.0**-30, -1.0
    inputs = tuple(Node(ca.OP_INPUT, (), (0, i)) for i in range(3))
    program = Program((*inputs, *(Node(op, (0, 1, 2)) for op in (FMA, FMS, FNMA))), ((3, 4, 5),))
    values = evaluate(program, [np.array([[a], [b], [c]])])[:, 0]
    # exactly a b - 1 = -2^-60; where a host has no fused operation it is 0
    assert values[0] in (-(2.0**-60), 0.0)
    np.testing.assert_allclose(values[1:], [a * b + 1, c - a * b], rtol=1e-15)


def test_branch_not_taken_may_be_infinite_in_the_derivative():
    x = ca.SX.sym("x")
    y = ca.if_else(x > 0, ca.sqrt(x), 0)
    slope = ca.Function("slope", [x], [ca.jacobian(y, x)])
    np.testing.assert_array_equal(evaluate_function(slope, np.array([[-1.0, 0.0, 4.0]])), [[0.0, 0.0, 0.25]])


def test_contraction_changes_rounding_only(rng):
    x = ca.SX.sym("x", 3)
    y = ca.vertcat(
        x[0] * x[1] + x[2], x[0] / x[2] - x[1] / x[2], x[0] ** 2 - x[1] * x[2], 2 * x[0] - 3, 5 - x[1] * x[2]
    )
    function = ca.Function("f", [x], [y])
    points = rng.uniform(0.5, 2, (3, 100))
    program = contract(trace(function), [LANE])
    assert {node.op for node in program.nodes} >= {FMA, FMS, FNMA, ca.OP_INV}
    np.testing.assert_allclose(evaluate(program, [points]), casadi_values(function, points), rtol=1e-14, atol=1e-14)
