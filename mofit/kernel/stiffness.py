"""How fast the equations can change, at a parameter set."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit.kernel.evaluate import evaluate
from mofit.kernel.program import Program, trace
from mofit.model import System

Array = NDArray[np.float64]

#: the norm is taken of the Jacobian's power 2 ** this
_SQUARINGS = 4


class Stiffness:
    r"""Fastest rate of the equations at a parameter set, 1/s.

    The largest over the probes of :math:`\|J^{16}\|_\infty^{1/16}`, :math:`J = \partial f / \partial x`; it lies
    little above the spectral radius, whatever the units of the states.

    Parameters
    ----------
    system
        The model.
    x, u, c
        The probes: states, inputs and conditions, one per column.
    """

    def __init__(self, system: System, x: Array, u: Array, c: Array) -> None:
        self.program = _program(system)
        self.x, self.u, self.c = x, u, c

    def __call__(self, p: Array) -> Array:
        """Of parameter sets (N, np), shape (N,)."""
        count, probes = len(p), self.x.shape[1]
        x, u, c = (np.tile(block, (1, count)) for block in (self.x, self.u, self.c))
        rates = evaluate(self.program, [x, u, np.repeat(p.T, probes, axis=1), c])
        return np.asarray(np.max(rates[0].reshape(count, probes), axis=1))


def _program(system: System) -> Program:
    x, u, p, c = (ca.SX.sym(name, *system.rhs.size_in(name)) for name in ("x", "u", "p", "c"))
    power = ca.jacobian(system.rhs(x, u, p, c), x)
    for _ in range(_SQUARINGS):
        power = power @ power
    size = ca.SX(0)
    for row in range(len(system.states)):
        size = ca.fmax(size, ca.sum2(ca.fabs(power[row, :])))
    for _ in range(_SQUARINGS):
        size = ca.sqrt(size)
    return trace(ca.Function("stiffness", [x, u, p, c], [ca.densify(size)]))
