"""More ways to compute the task of the kernel benchmark: lanes in Numba, and solvers that compile the equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.kernel_peers import FREE, FREQUENCIES, Evaluate, Task, accumulated_step, input_nodes
from benchmarks.rows import imported

TOLERANCE = 1e-6


def numba_lanes(task: Task) -> Evaluate:
    """Numba: the same Runge-Kutta step as CasADi's rows, line by line, in a loop over parameter sets for each sample.

    The loop is innermost, so that the compiler may put the sets into the lanes of a register. Residual, gradient,
    Gauss-Newton matrix.
    """
    numba = imported("numba")
    step = accumulated_step(task)
    names = ("state[{1}, i]", "u[k, {1}]", "m[k]", "free[{1}, i]", "fixed[{1}]")
    body = "\n            ".join(_lines(step, names, names[0]))
    source = (
        "def whole(u, m, free, fixed, state):\n"
        "    for k in range(u.shape[0]):\n"
        "        for i in range(free.shape[1]):\n"
        f"            {body}\n"
    )
    space: dict[str, Any] = {"sqrt": math.sqrt, "sin": math.sin, "cos": math.cos}
    exec(source, space)  # the text is made here
    whole = numba.njit(fastmath=True, error_model="numpy")(space["whole"])
    free = [task.system.parameters.index(name) for name in FREE]
    fixed = np.array([task.nominal[k] for k in range(len(task.nominal)) if k not in free])
    tests = [
        (np.ascontiguousarray(u.T), np.ascontiguousarray(e.measured[:, 0]))
        for u, e in zip(input_nodes(task), task.experiments, strict=True)
    ]
    sums, nf = step.numel_out(0), len(FREE)
    first = sums - (1 + nf + nf * nf)

    def evaluate(p: np.ndarray) -> np.ndarray:
        values, cost = np.ascontiguousarray(p[:, free].T), np.zeros(len(p))
        for u, m in tests:
            state = np.zeros((sums, len(p)))
            whole(u, m, values, fixed, state)
            cost += state[first]
        return cost

    return evaluate


def _lines(function: ca.Function, arguments: Sequence[str], result: str) -> list[str]:
    """The instructions of an SX function as lines of Python; ``{1}`` in a name stands for the element."""
    rules: dict[int, str] = {
        ca.OP_ADD: "{} + {}", ca.OP_SUB: "{} - {}", ca.OP_MUL: "{} * {}", ca.OP_DIV: "{} / {}", ca.OP_NEG: "-{}",
        ca.OP_SQ: "{0} * {0}", ca.OP_TWICE: "{0} + {0}", ca.OP_INV: "1.0 / {}", ca.OP_FABS: "abs({})",
        ca.OP_SIN: "sin({})", ca.OP_COS: "cos({})", ca.OP_SQRT: "sqrt({})", ca.OP_FMIN: "min({}, {})",
        ca.OP_FMAX: "max({}, {})", ca.OP_LE: "1.0 if {} <= {} else 0.0", ca.OP_LT: "1.0 if {} < {} else 0.0",
        ca.OP_NOT: "1.0 - {}", ca.OP_IF_ELSE_ZERO: "{1} if {0} != 0.0 else 0.0",
        ca.OP_SIGN: "(1.0 if {0} > 0.0 else 0.0) - (1.0 if {0} < 0.0 else 0.0)",
    }  # fmt: skip
    lines, stores = [], []
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        read, written = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            lines.append(f"w{written[0]} = {function.instruction_constant(k)!r}")
        elif op == ca.OP_INPUT:
            lines.append(f"w{written[0]} = " + arguments[read[0]].replace("{1}", str(read[1])))
        elif op == ca.OP_OUTPUT:  # what is written may be read again, and a place of the work vector used again
            lines.append(f"o{written[1]} = w{read[0]}")
            stores.append(result.replace("{1}", str(written[1])) + f" = o{written[1]}")
        else:
            lines.append(f"w{written[0]} = " + rules[op].format(*(f"w{i}" for i in read)))
    return lines + stores


def heyoka_cost(task: Task) -> Evaluate:
    """heyoka: Taylor's method, compiled, a register full of parameter sets at once; cost only.

    Its series runs across the kinks of ``|y|`` and of ``|slip|``.
    """
    hy = imported("heyoka")
    time, width = task.time, hy.recommended_simd_size()
    y, inner_y = hy.make_vars("y", "y_m")
    rates, force = _motion(
        task, [hy.par[k] for k in range(9)], (y, inner_y), hy.time, hy.sin, hy.cos, lambda v: hy.relu(v) + hy.relu(-v)
    )
    equations = list(zip((y, inner_y), rates, strict=True))
    solver = hy.taylor_adaptive_batch(equations, np.zeros((2, width)), tol=TOLERANCE, compact_mode=True)
    output = hy.cfunc([force], [y, inner_y], compact_mode=True)
    grid = np.repeat(time[:, None], width, axis=1)

    def cost(p: np.ndarray) -> np.ndarray:
        found = np.zeros(width)
        for frequency, experiment in zip(FREQUENCIES, task.experiments, strict=True):
            solver.pars[:8], solver.pars[8] = p.T, 2 * math.pi * frequency
            solver.state[:] = 0.0
            solver.set_time(0.0)
            states = solver.propagate_grid(grid)[1].transpose(1, 0, 2).reshape(2, -1)
            pars = np.broadcast_to(solver.pars[:, None], (9, len(time), width)).reshape(9, -1)
            simulated = output(states, pars=np.ascontiguousarray(pars), time=grid.ravel()).reshape(len(time), width)
            found += ((simulated - experiment.measured) ** 2).sum(axis=0)
        return found

    def evaluate(p: np.ndarray) -> np.ndarray:
        padded = np.concatenate([p, np.repeat(p[-1:], -len(p) % width, axis=0)])
        return np.concatenate([cost(padded[k : k + width]) for k in range(0, len(padded), width)])[: len(p)]

    return evaluate


def _motion(
    task: Task, p: Sequence[Any], state: tuple[Any, Any], t: Any, sin: Callable, cos: Callable, size: Callable
) -> tuple[tuple[Any, Any], Any]:
    """Rates and force of the tyre in a solver's own expressions; the last of ``p`` is the angular frequency."""
    speed, factor, fictitious = task.conditions
    slope, s_max, f_max, c_y, p_y, d_y, c_m, d_m, omega = p
    y, y_m = state
    angle = task.amplitude * sin(omega * t)
    transport = speed * cos(angle) * factor + fictitious
    slip = speed * sin(angle) / transport
    sigma = size(slip) / s_max
    stiffness = slope / (1.0 + sigma * (sigma + slope * s_max / f_max - 2.0))
    inner = c_y * (1.0 + p_y * size(y)) * y + c_m * (y - y_m)
    rate = transport * (stiffness * slip - inner) / (transport * d_y + stiffness)
    return (rate, c_m / d_m * (y - y_m)), inner + d_y * rate


def diffsol_sensitivities(task: Task) -> Evaluate:
    """Diffsol (pydiffsol): Tsitouras 4/5, compiled by LLVM, with forward sensitivities; one system per test.

    Residual, gradient, Gauss-Newton matrix.
    """
    ds = imported("pydiffsol")
    free = [task.system.parameters.index(name) for name in FREE]
    solvers = []
    for frequency in FREQUENCIES:
        text = _diffsl(task, 2 * math.pi * frequency)
        solver = ds.Ode(text, matrix_type=ds.nalgebra_dense, jit_backend=ds.llvm, ode_solver=ds.tsit45)
        solver.rtol, solver.atol, solver.sens_rtol, solver.sens_atol = TOLERANCE, 1e-10, TOLERANCE, 1e-10
        solvers.append(solver)

    def cost(values: np.ndarray) -> float:
        total = 0.0
        for solver, experiment in zip(solvers, task.experiments, strict=True):
            found = solver.solve_fwd_sens(values, task.time)
            residual = found.ys[0] - experiment.measured[:, 0]
            slopes = np.stack([one[0] for one in found.sens])
            total += float(residual @ residual)
            _ = slopes @ residual, slopes @ slopes.T
        return total

    return lambda p: np.array([cost(np.ascontiguousarray(row[free])) for row in p])


def _diffsl(task: Task, omega: float) -> str:
    """The tyre in Diffsol's language, whose names have no underscores; the free parameters are inputs."""
    speed, factor, fictitious = task.conditions
    names = ("slope", "smax", "fmax", "cy", "py", "dy", "cm", "dm")
    free = [task.system.parameters.index(name) for name in FREE]
    inputs = ", ".join(f"{names[k]} = {float(task.nominal[k])!r}" for k in free)
    fixed = "\n".join(f"{name} {{ {float(task.nominal[k])!r} }}" for k, name in enumerate(names) if k not in free)
    return f"""
in_i {{ {inputs} }}
{fixed}
u_i {{ y = 0.0, z = 0.0 }}
angle {{ {task.amplitude!r} * sin({omega!r} * t) }}
transport {{ {speed!r} * cos(angle) * {factor!r} + {fictitious!r} }}
slip {{ {speed!r} * sin(angle) / transport }}
sigma {{ abs(slip) / smax }}
stiffness {{ slope / (1.0 + sigma * (sigma + slope * smax / fmax - 2.0)) }}
inner {{ cy * (1.0 + py * abs(y)) * y + cm * (y - z) }}
rate {{ transport * (stiffness * slip - inner) / (transport * dy + stiffness) }}
F_i {{ rate, cm / dm * (y - z) }}
out_i {{ inner + dy * rate }}
"""
