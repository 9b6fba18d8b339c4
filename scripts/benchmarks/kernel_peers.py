"""The task of the kernel benchmark, the paper's tyre on nine sine tests, and other ways to compute it.

Each way takes a task and returns a function of a batch of parameter sets.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.rows import Absent, imported
from mofit._typing import FloatArray
from mofit.models import System, build_system
from mofit.models.library.tyres import MaxwellTyre
from mofit.simulation import ExperimentData
from mofit.simulation.integrators import RK4, build_graph

FREQUENCIES = (0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0)
FREE = ("d_y", "c_M", "d_M")


@dataclass(frozen=True)
class Task:
    """Sine tests of 1 degree at 40 km/h, 630 samples at 100 Hz each: 5,670 Runge-Kutta steps for all of them.

    The measured outputs are noise; every sample counts.
    """

    samples: int = 630
    step: float = 0.01
    amplitude: float = math.radians(1.0)
    conditions: tuple[float, ...] = (40 / 3.6, 1.0, 0.01)

    @cached_property
    def system(self) -> System:
        """The model in vector form."""
        return build_system(MaxwellTyre())

    @cached_property
    def time(self) -> FloatArray:
        """Sampling times of every test, s."""
        return np.asarray(np.arange(self.samples) * self.step, dtype=float)

    @property
    def steps(self) -> int:
        """Steps of one evaluation of all tests."""
        return self.samples * len(FREQUENCIES)

    @cached_property
    def nominal(self) -> FloatArray:
        """A parameter set."""
        return np.array([parameter.nominal for parameter in MaxwellTyre.parameters])

    def parameters(self, count: int) -> FloatArray:
        """Sets around it in the free parameters, (count, np)."""
        p = np.tile(self.nominal, (count, 1))
        free = [self.system.parameters.index(name) for name in FREE]
        p[:, free] *= np.random.default_rng(1).uniform(0.8, 1.2, (count, len(FREE)))
        return p

    @cached_property
    def experiments(self) -> list[ExperimentData]:
        """The tests."""
        rng = np.random.default_rng(0)
        return [
            ExperimentData(
                name=f"{frequency:g} Hz",
                step=self.step,
                inputs=self.amplitude * np.sin(2 * np.pi * frequency * self.time)[:, None],
                interpolation="cubic",
                conditions=np.array(self.conditions),
                measured=1000 * rng.normal(size=(self.samples, 1)),
                weights=np.ones((self.samples, 1)),
            )
            for frequency in FREQUENCIES
        ]


#: parameter sets (N, np) -> cost (N,) of all tests together
Evaluate = Callable[[FloatArray], FloatArray]


def scipy_cost(task: Task) -> Evaluate:
    """`scipy.integrate.solve_ivp`, RK45 at 1e-6, with the equations in plain Python; cost only."""
    time = task.time
    speed, factor, fictitious = task.conditions

    def cost_of_test(p: FloatArray, frequency: float, measured: FloatArray) -> float:
        slope, s_max, f_max, c_y, p_y, d_y, c_m, d_m = map(float, p)
        omega = 2 * math.pi * frequency

        def motion(t: float, y: float, y_m: float) -> tuple[float, float, float]:
            angle = task.amplitude * math.sin(omega * t)
            transport = abs(speed * math.cos(angle)) * factor + fictitious
            slip = speed * math.sin(angle) / transport
            sigma = abs(slip) / s_max
            stiffness = slope / (1 + sigma * (sigma + slope * s_max / f_max - 2))
            inner = c_y * (1 + p_y * abs(y)) * y + c_m * (y - y_m)
            rate = transport * (stiffness * slip - inner) / (transport * d_y + stiffness)
            return rate, c_m / d_m * (y - y_m), inner + d_y * rate

        found = solve_ivp(
            lambda t, x: motion(t, x[0], x[1])[:2], (0, time[-1]), (0.0, 0.0), t_eval=time, rtol=1e-6, atol=1e-10
        )
        force = np.array([motion(t, *x)[2] for t, x in zip(time, found.y.T, strict=True)])
        return float(np.sum((force - measured) ** 2))

    def evaluate(p: FloatArray) -> FloatArray:
        pairs = list(zip(FREQUENCIES, task.experiments, strict=True))
        return np.array([sum(cost_of_test(row, f, experiment.measured[:, 0]) for f, experiment in pairs) for row in p])

    return evaluate


def accumulated_step(task: Task) -> ca.Function:
    """A Runge-Kutta step from the state to the next, and the sums: cost, gradient, Gauss-Newton matrix."""
    system, nf = task.system, len(FREE)
    nx = len(system.states) * (1 + nf)
    graph = build_graph(system, RK4, FREE, derivatives=True)
    state, inputs, measured = ca.SX.sym("state", nx + 1 + nf + nf * nf), ca.SX.sym("u", 3), ca.SX.sym("measured")
    free, fixed = ca.SX.sym("free", nf), ca.SX.sym("fixed", len(system.parameters) - nf)
    _, following, output = graph(free, state[:nx], inputs, 0, inputs[0], fixed, ca.DM(task.conditions), task.step)
    residual, slopes = output[0] - measured, output[1:]
    sums = state[nx:] + ca.vertcat(residual**2, slopes * residual, ca.vec(slopes @ slopes.T))
    return ca.Function("step", [state, inputs, measured, free, fixed], [ca.vertcat(following, sums)])


def input_nodes(task: Task) -> list[FloatArray]:
    """Of each test the input at the nodes of every Runge-Kutta step, (nodes, samples)."""
    return [
        np.stack([experiment.at(task.time + node * task.step)[0] for node in RK4.nodes])
        for experiment in task.experiments
    ]


def _accumulated(task: Task) -> ca.Function:
    """Sums of one test by CasADi's `mapaccum` over Runge-Kutta steps."""
    step, nx = accumulated_step(task), len(task.system.states) * (1 + len(FREE))
    state, free, fixed = (step.sx_in(k) for k in (0, 3, 4))
    whole = step.mapaccum("whole", task.samples)
    start, u, m = ca.MX.sym("start", state.numel()), ca.MX.sym("u", 3, task.samples), ca.MX.sym("m", 1, task.samples)
    p, q = ca.MX.sym("free", free.numel()), ca.MX.sym("fixed", fixed.numel())
    ends = whole(start, u, m, ca.repmat(p, 1, task.samples), ca.repmat(q, 1, task.samples))
    return ca.Function("sums", [start, u, m, p, q], [ends[nx:, -1]])


def _casadi_evaluate(task: Task, function: ca.Function) -> Evaluate:
    free = [task.system.parameters.index(name) for name in FREE]
    fixed = [i for i in range(len(task.system.parameters)) if i not in free]
    nodes = [ca.DM(nodes) for nodes in input_nodes(task)]
    measured = [ca.DM(experiment.measured.T) for experiment in task.experiments]
    # at rest at the start, where the slip is zero; the derivatives too
    start = ca.DM.zeros(function.numel_in(0))

    def evaluate(p: FloatArray) -> FloatArray:
        costs = []
        for row in p:
            sums = [function(start, u, m, row[free], row[fixed]) for u, m in zip(nodes, measured, strict=True)]
            costs.append(sum(float(values[0]) for values in sums))
        return np.array(costs)

    return evaluate


def casadi_machine(task: Task) -> Evaluate:
    """CasADi's virtual machine; residual, gradient, Gauss-Newton matrix."""
    return _casadi_evaluate(task, _accumulated(task))


def casadi_compiled(task: Task) -> Evaluate:
    """CasADi's generated C, compiled with ``gcc -O3 -march=native``; residual, gradient, Gauss-Newton matrix."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise Absent("no C compiler")
    folder = Path(tempfile.mkdtemp(prefix="mofit_bench_"))
    source, library = folder / "sums.c", folder / "sums.so"
    generator = ca.CodeGenerator("sums.c")
    generator.add(_accumulated(task))
    generator.generate(f"{folder}/")
    command = [compiler, "-O3", "-march=native", "-fPIC", "-shared", str(source), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    evaluate = _casadi_evaluate(task, ca.external("sums", str(library)))
    shutil.rmtree(folder)
    return evaluate


def jax_batched(task: Task) -> Evaluate:
    """JAX in double precision: jit, vmap over parameter sets and tests, scan over steps, forward derivatives."""
    jax = imported("jax")
    jnp = jax.numpy
    jax.config.update("jax_enable_x64", True)
    rates, outputs = (_as_jax(function, jnp) for function in (task.system.rhs, task.system.out))
    free = jnp.array([task.system.parameters.index(name) for name in FREE])
    conditions, h = list(task.conditions), task.step
    time = task.time
    nodes = jnp.array([[experiment.at(time + node * h)[0] for node in RK4.nodes] for experiment in task.experiments])
    measured = jnp.array([experiment.measured[:, 0] for experiment in task.experiments])
    nominal = jnp.array(task.nominal)

    def residual(values: Any, u: Any, m: Any) -> Any:
        p = list(nominal.at[free].set(values))
        f = lambda x, v: jnp.stack(rates([list(x), [v], p, conditions]))  # noqa: E731

        def step(x: Any, v: Any) -> tuple[Any, Any]:
            k1 = f(x, v[0])
            k2 = f(x + h / 2 * k1, v[1])
            k3 = f(x + h / 2 * k2, v[1])
            k4 = f(x + h * k3, v[2])
            return x + h / 6 * (k1 + 2 * (k2 + k3) + k4), outputs([list(x), [v[0]], p, conditions])[0]

        return jax.lax.scan(step, jnp.zeros(len(task.system.states)), u.T)[1] - m

    def sums(values: Any, u: Any, m: Any) -> Any:
        push = lambda seed: jax.jvp(lambda v: residual(v, u, m), (values,), (seed,))  # noqa: E731
        r, slopes = jax.vmap(push, out_axes=(None, 0))(jnp.eye(len(FREE)))
        return r @ r, slopes @ r, slopes @ slopes.T

    whole = jax.jit(jax.vmap(jax.vmap(sums, (None, 0, 0)), (0, None, None)))

    def evaluate(p: FloatArray) -> FloatArray:
        found = jax.block_until_ready(whole(jnp.array(p)[:, free], nodes, measured))
        return np.asarray(found[0].sum(axis=1))

    return evaluate


def _as_jax(function: ca.Function, jnp: Any) -> Callable[[list[Any]], list[Any]]:
    """An SX function, element by element, in JAX operations."""
    rules: dict[int, Callable[..., Any]] = {
        ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
        ca.OP_DIV: lambda a, b: a / b, ca.OP_NEG: lambda a: -a, ca.OP_SQ: lambda a: a * a, ca.OP_TWICE: lambda a: 2 * a,
        ca.OP_INV: lambda a: 1 / a, ca.OP_FABS: jnp.abs, ca.OP_SIN: jnp.sin, ca.OP_COS: jnp.cos,
        ca.OP_FMIN: jnp.minimum, ca.OP_FMAX: jnp.maximum, ca.OP_LE: lambda a, b: a <= b, ca.OP_LT: lambda a, b: a < b,
        ca.OP_NOT: jnp.logical_not, ca.OP_IF_ELSE_ZERO: lambda a, b: jnp.where(a, b, 0.0),
    }  # fmt: skip

    def evaluate(arguments: list[Any]) -> list[Any]:
        work: dict[int, Any] = {}
        result = [0.0] * function.nnz_out(0)
        for k in range(function.n_instructions()):
            op = function.instruction_id(k)
            read, written = function.instruction_input(k), function.instruction_output(k)
            if op == ca.OP_CONST:
                work[written[0]] = function.instruction_constant(k)
            elif op == ca.OP_INPUT:
                work[written[0]] = arguments[read[0]][read[1]]
            elif op == ca.OP_OUTPUT:
                result[written[1]] = work[read[0]]
            else:
                work[written[0]] = rules[op](*(work[i] for i in read))
        return result

    return evaluate
