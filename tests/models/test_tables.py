"""Tables in equations: ``ca.pw_lin`` is an expression; ``ca.interpolant`` is written out as one."""

import casadi as ca
import numpy as np
import pytest

from mofit.errors import InputError
from mofit.models import Channel, Equations, Model, build_system
from mofit.models.lookup_tables import written_out

GRID, VALUES = [-1.0, -0.01, 0.0, 0.01, 1.0], [-100.0, -10.0, 0.0, 20.0, 200.0]


class Table(Model):
    name = "table"
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def __init__(self, look_up):
        self.look_up = look_up

    def equations(self, s):
        return Equations(outputs={"force": self.look_up(s.displacement)})


def test_a_piecewise_linear_table_is_interpolated():
    system = build_system(Table(lambda x: ca.pw_lin(x, GRID, VALUES)))
    for x in np.linspace(-0.02, 0.02, 9):
        assert float(system.out([], x, [], [])) == pytest.approx(np.interp(x, GRID, VALUES))


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_an_interpolant_is_written_out(kind):
    table = ca.interpolant("lut", kind, [GRID], VALUES)
    system = build_system(Table(lambda x: 2 * table(3 * x) - x))
    x = np.concatenate([np.linspace(-0.5, 0.5, 41), np.array(GRID) / 3])
    assert not system.out.get_function()
    expected = [2 * float(table(3 * v)) - v for v in x]
    assert [float(system.out([], v, [], [])) for v in x] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_table_of_several_inputs_and_outputs_is_written_out(kind):
    rng = np.random.default_rng(0)
    grids = [np.sort(rng.random(n)).tolist() for n in (5, 4, 6)]
    table = ca.interpolant("lut", kind, grids, rng.random(2 * 5 * 4 * 6).tolist())
    x = ca.SX.sym("x", 3)
    written = ca.Function("written", [x], [written_out("here", table(x))])
    assert not written.get_function()
    inside = [[grid[0] + share * (grid[-1] - grid[0]) for grid in grids] for share in rng.random(20)]
    outside = [] if kind == "bspline" else [[-1.0, 2.0, 3.0], [grids[0][0], 0.5, -1.0]]
    for point in [*inside, *outside]:
        np.testing.assert_allclose(written(point), table(point), rtol=1e-7, atol=1e-9)


def test_tables_within_functions_of_several_arguments_are_written_out():
    table = ca.interpolant("lut", "linear", [GRID], VALUES)
    a, b = ca.MX.sym("a"), ca.MX.sym("b", 2)
    function = ca.Function("f", [a, b], [table(a) * b[1], ca.vertcat(b[0] + a, ca.sin(a))])
    x = ca.SX.sym("x")
    first, second = function(x, ca.vertcat(x, x + 1))
    written = ca.Function("written", [x], [written_out("here", ca.vertcat(second[1], first, second[0]))])
    assert not written.get_function()
    assert written(0.3).full().ravel() == pytest.approx([np.sin(0.3), 1.3 * float(table(0.3)), 0.6])


def test_what_is_no_expression_is_refused_with_the_cure():
    x = ca.MX.sym("x")
    root = ca.rootfinder("root", "newton", {"x": x, "p": (p := ca.MX.sym("p")), "g": x**3 + x - p})
    with pytest.raises(InputError, match=r"is no expression \(root, Newton\).*ca\.interpolant"):
        build_system(Table(lambda u: root(0.0, u)))
