"""One integrator step as an SX function, and its exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

import casadi as ca

from mofit.models import System
from mofit.simulation.compiler.program import LANE, TIME

#: right-hand side: ``(x, u) -> dx/dt``
RightSide = Callable[[ca.SX, ca.SX], ca.SX]
#: ``(right-hand side, x, [u at each node], du/dt at the start, h) -> x at the end``
Advance = Callable[[RightSide, ca.SX, Sequence[ca.SX], ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True)
class Scheme:
    """A one-step method: ``advance`` reads the inputs at ``nodes`` of the step (0 to 1; the first is 0).

    An ``explicit`` method needs no Jacobian: its sensitivities are the same step of the variational equations. It is
    not for transients that decay at once: the first sampling interval is not refined for it. ``cost`` is that of a
    step, relative to RK4.
    """

    name: str
    nodes: tuple[float, ...]
    advance: Advance
    explicit: bool
    cost: float

    @property
    def digest(self) -> tuple[object, ...]:
        """All that decides the graph of a step, in brief."""
        return self.name, self.nodes, self.explicit, self.advance.__module__, self.advance.__qualname__, _source()


@cache
def _source() -> str:
    """Hash of this module, which writes graphs."""
    return sha256(Path(__file__).read_bytes()).hexdigest()


def _rk4(rhs: RightSide, x: ca.SX, inputs: Sequence[ca.SX], input_rate: ca.SX, h: ca.SX) -> ca.SX:
    start, middle, end = inputs
    k1 = rhs(x, start)
    k2 = rhs(x + h / 2 * k1, middle)
    k3 = rhs(x + h / 2 * k2, middle)
    k4 = rhs(x + h * k3, end)
    return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)


#: the classical Runge-Kutta method
RK4 = Scheme("RK4", (0.0, 0.5, 1.0), _rk4, explicit=True, cost=1.0)

# RODAS4, stages (I / (gamma h) - J) U_i = f(t + c_i h, x + A_i U) + C_i U / h + d_i h df/dt: gamma, A, C, c, d
_GAMMA = 0.25
_A = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
)
_C = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)
_STAGE_NODES = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
_NODES = tuple(dict.fromkeys(_STAGE_NODES))
_D = (0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0)


def _rodas4(rhs: RightSide, x: ca.SX, inputs: Sequence[ca.SX], input_rate: ca.SX, h: ca.SX) -> ca.SX:
    f = rhs(x, inputs[0])
    jacobian, drift = ca.jacobian(f, x), ca.jtimes(f, inputs[0], input_rate)
    solve = _factorised(ca.SX.eye(x.numel()) / (_GAMMA * h) - jacobian)
    stages: list[ca.SX] = []
    at = x
    for i, node in enumerate(_STAGE_NODES):
        if i < len(_A):
            at = x + sum((a * stage for a, stage in zip(_A[i], stages, strict=True)), ca.SX.zeros(x.shape))
        else:  # stiffly accurate: the last stages correct the result itself
            at = at + stages[-1]
        f = rhs(at, inputs[_NODES.index(node)])
        memory = sum((c * stage for c, stage in zip(_C[i], stages, strict=True)), ca.SX.zeros(x.shape))
        stages.append(solve(f + memory / h + _D[i] * h * drift))
    return at + stages[-1]


def _factorised(matrix: ca.SX) -> Callable[[ca.SX], ca.SX]:
    """Solver of ``matrix @ z = b`` by elimination without pivoting; zeros of the pattern cost nothing."""
    n = matrix.shape[0]
    rows = [[matrix[i, j] for j in range(n)] for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            rows[i][k] = rows[i][k] / rows[k][k]
            for j in range(k + 1, n):
                rows[i][j] = rows[i][j] - rows[i][k] * rows[k][j]

    def solve(right: ca.SX) -> ca.SX:
        z = [right[i] for i in range(n)]
        for i in range(n):
            for k in range(i):
                z[i] = z[i] - rows[i][k] * z[k]
        for i in reversed(range(n)):
            for k in range(i + 1, n):
                z[i] = z[i] - rows[i][k] * z[k]
            z[i] = z[i] / rows[i][i]
        return ca.vertcat(*z)

    return solve


#: stiffly accurate, L-stable Rosenbrock method of order 4
#: (Hairer & Wanner, Solving Ordinary Differential Equations II, 2nd ed., section VI.4)
RODAS4 = Scheme("RODAS4", _NODES, _rodas4, explicit=False, cost=4.0)

#: inputs of `build_graph`'s functions, with the level of each
GRAPH_INPUTS = {
    "free": LANE,  # parameters that are differentiated, one set per lane
    "state": LANE | TIME,  # x, then the columns of dx/dfree
    "input": TIME,  # inputs at every node, one node after another
    "input_rate": TIME,  # du/dt at the start
    "first": 0,  # the test's first sample of the inputs
    "fixed": 0,  # all other parameters
    "condition": 0,
    "h": TIME,
}


def free_first(names: Sequence[str], free: Sequence[str]) -> list[int]:
    """Places in ``names`` of the free parameters, then of all others."""
    order = [names.index(name) for name in free]
    return order + [index for index in range(len(names)) if index not in order]


def build_graph(system: System, scheme: Scheme, free: Sequence[str], derivatives: bool) -> ca.Function:
    """Initial state, one step and the outputs at its start, with sensitivities if ``derivatives``.

    Returns
    -------
    casadi.Function
        Inputs as in `GRAPH_INPUTS`; outputs ``initial`` and ``next`` (x, then the columns of
        dx/dfree), ``output`` (y, then the columns of dy/dfree).
    """
    nx, nu, nf = len(system.states), len(system.inputs), len(free)
    pf, px = ca.SX.sym("free", nf), ca.SX.sym("fixed", len(system.parameters) - nf)
    x, c, h = ca.SX.sym("x", nx), ca.SX.sym("c", len(system.conditions)), ca.SX.sym("h")
    u, input_rate, first = ca.SX.sym("u", nu, len(scheme.nodes)), ca.SX.sym("input_rate", nu), ca.SX.sym("first", nu)
    p = ca.SX(len(system.parameters), 1)
    p[free_first(system.parameters, free)] = ca.vertcat(pf, px)
    inputs = [u[:, node] for node in range(len(scheme.nodes))]
    start, y = system.initial(first, p, c), system.out(x, inputs[0], p, c)

    def rhs(x: ca.SX, u: ca.SX) -> ca.SX:
        return system.rhs(x, u, p, c)

    state = ca.horzcat(x, ca.SX.sym("sx", nx, nf)) if derivatives else x
    if not nx:
        end = state
    elif derivatives and scheme.explicit:
        end = scheme.advance(_variational(rhs, x, inputs[0], pf), state, inputs, input_rate, h)
    else:
        end = scheme.advance(rhs, x, inputs, input_rate, h)
        if derivatives:
            seeds = ca.vertcat(state[:, 1:], ca.SX.eye(nf))
            end = ca.horzcat(end, ca.jtimes(end, ca.vertcat(x, pf), seeds))
    if derivatives:
        start, y = ca.horzcat(start, ca.jacobian(start, pf)), _with_sensitivities(y, x, pf, state)
    return ca.Function(
        "graph",
        [pf, ca.vec(state), ca.vec(u), input_rate, first, px, c, h],
        [ca.densify(ca.vec(result)) for result in (start, end, y)],
        list(GRAPH_INPUTS),
        ["initial", "next", "output"],
    )


def _with_sensitivities(value: ca.SX, x: ca.SX, free: ca.SX, state: ca.SX) -> ca.SX:
    """``value`` and its derivatives by the free parameters, as columns, where ``state`` is that of x."""
    return ca.horzcat(value, ca.jacobian(value, x) @ state[:, 1:] + ca.jacobian(value, free))


def _variational(rhs: RightSide, x: ca.SX, u: ca.SX, free: ca.SX) -> RightSide:
    """Derivatives in time of the state and of its sensitivities, as columns: the variational equations."""
    state = ca.horzcat(x, ca.SX.sym("sx", x.numel(), free.numel()))
    extended = _with_sensitivities(rhs(x, u), x, free, state)

    def extended_rhs(at: ca.SX, inputs: ca.SX) -> ca.SX:
        return ca.substitute([extended], [ca.vec(state), u], [ca.vec(at), inputs])[0]

    return extended_rhs
