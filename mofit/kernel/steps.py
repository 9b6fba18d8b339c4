"""One integrator step as an SX function, and its exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from mofit.kernel.program import LANE, TIME
from mofit.model import System

#: ``(rhs, x, [u at each node], du/dt at the start, h) -> x at the end``
Advance = Callable[[Callable[[ca.SX, ca.SX], ca.SX], ca.SX, Sequence[ca.SX], ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True)
class Scheme:
    """A one-step method.

    Parameters
    ----------
    name
        For people.
    nodes
        Where in the step (0 to 1) it reads the inputs; the first is 0.
    advance
        The step itself.
    order
        Order of convergence.
    """

    name: str
    nodes: tuple[float, ...]
    advance: Advance
    order: int


def _rk4(
    rhs: Callable[[ca.SX, ca.SX], ca.SX], x: ca.SX, inputs: Sequence[ca.SX], slope: ca.SX, h: ca.SX
) -> ca.SX:
    start, middle, end = inputs
    k1 = rhs(x, start)
    k2 = rhs(x + h / 2 * k1, middle)
    k3 = rhs(x + h / 2 * k2, middle)
    k4 = rhs(x + h * k3, end)
    return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)


#: the classical Runge-Kutta method
RK4 = Scheme("RK4", (0.0, 0.5, 1.0), _rk4, 4)

#: inputs of `build_graph`'s functions, with the level of each
GRAPH_INPUTS = {
    "free": LANE,  # parameters that are differentiated, one set per lane
    "state": LANE | TIME,  # x, then the columns of dx/dfree
    "input": TIME,  # inputs at every node, one node after another
    "slope": TIME,  # du/dt at the start
    "first": 0,  # the test's first sample of the inputs
    "fixed": 0,  # all other parameters
    "condition": 0,
    "h": 0,
}


def build_graph(system: System, scheme: Scheme, free: Sequence[str], derivatives: bool) -> ca.Function:
    """Initial state, one step and the outputs at its start, with sensitivities if asked for.

    Returns
    -------
    casadi.Function
        Inputs as in `GRAPH_INPUTS`; outputs ``initial`` and ``next`` (x, then the columns of
        dx/dfree), ``output`` (y, then the columns of dy/dfree).
    """
    nx, nu, nf = len(system.states), len(system.inputs), len(free)
    pf, px = ca.SX.sym("free", nf), ca.SX.sym("fixed", len(system.parameters) - nf)
    x, c, h = ca.SX.sym("x", nx), ca.SX.sym("c", len(system.conditions)), ca.SX.sym("h")
    u, slope, first = ca.SX.sym("u", nu, len(scheme.nodes)), ca.SX.sym("slope", nu), ca.SX.sym("first", nu)
    rest = [name for name in system.parameters if name not in free]
    p = ca.vertcat(
        *(pf[list(free).index(name)] if name in free else px[rest.index(name)] for name in system.parameters)
    )
    inputs = [u[:, node] for node in range(len(scheme.nodes))]
    start = system.initial(first, p, c)
    end = scheme.advance(lambda x, u: system.rhs(x, u, p, c), x, inputs, slope, h) if nx else x
    y = system.out(x, u[:, 0], p, c)
    state, results = x, [start, end, y]
    if derivatives:
        sx = ca.SX.sym("sx", nx, nf)
        state = ca.veccat(x, sx)
        unit = ca.SX.eye(nf)
        results = [ca.veccat(start, ca.jtimes(start, pf, unit))] + [
            ca.veccat(value, ca.jtimes(value, ca.vertcat(x, pf), ca.vertcat(sx, unit))) for value in (end, y)
        ]
    return ca.Function(
        "graph",
        [pf, state, ca.vec(u), slope, first, px, c, h],
        [ca.densify(ca.vec(result)) for result in results],
        list(GRAPH_INPUTS),
        ["initial", "next", "output"],
    )
