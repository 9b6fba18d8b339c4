"""Tables in equations: ``ca.pw_lin`` is an expression; a lookup that is none is refused before anything runs."""

import casadi as ca
import numpy as np
import pytest

from mofit.errors import InputError
from mofit.models import Channel, Equations, Model, build_system

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


def test_an_interpolant_is_refused_with_the_cure():
    with pytest.raises(InputError, match=r"is no expression \(lut\).*ca\.pw_lin"):
        build_system(Table(ca.interpolant("lut", "linear", [GRID], VALUES)))
