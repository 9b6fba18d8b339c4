"""The kernel beside other ways to integrate the paper's model and differentiate the result, in one run."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from llvmlite import binding

from benchmarks import kernel_peers, kernel_solvers
from benchmarks.kernel_peers import FREE, Evaluate, Task
from benchmarks.rows import row
from mofit.simulation import Simulator
from mofit.simulation.compiler.emit import Emitter
from mofit.simulation.compiler.instructions import PTR, Value, integer
from mofit.simulation.compiler.machine import compile_entry, host
from mofit.simulation.compiler.program import FMA, FMS, FNMA, LANE, TIME
from mofit.simulation.integrators import RK4
from mofit.simulation.kernel import Kernel
from studies.report_page import versions

_GAUSS_NEWTON = "residual + gradient + Gauss-Newton"
#: name, result, factory, parameter sets per call
Peer = tuple[str, str, Callable[[Task], Evaluate], int]
PEERS: tuple[Peer, ...] = (
    ("scipy solve_ivp (RK45, 1e-6)", "cost", kernel_peers.scipy_cost, 1),
    ("CasADi virtual machine", _GAUSS_NEWTON, kernel_peers.casadi_machine, 1),
    ("CasADi C code, gcc -O3", _GAUSS_NEWTON, kernel_peers.casadi_compiled, 1),
    ("JAX (jit, vmap, scan)", _GAUSS_NEWTON, kernel_peers.jax_batched, 64),
    ("Numba, lanes", _GAUSS_NEWTON, kernel_solvers.numba_lanes, 64),
    ("Diffsol (Tsit45, 1e-6)", _GAUSS_NEWTON, kernel_solvers.diffsol_sensitivities, 1),
    ("heyoka (Taylor, 1e-6)", "cost", kernel_solvers.heyoka_cost, 64),
)


#: Those of them that do the kernel's own steps.
SAME_STEPS = ("CasADi virtual machine", "CasADi C code, gcc -O3", "JAX (jit, vmap, scan)", "Numba, lanes")
EXPLAINED = {
    "fraction of peak": "operations of the steps by the most that the core does (a multiply-add in every lane); of "
    "those that do the kernel's steps",
    "fraction of bound": "what multiply-adds and divisions would take, each at its own peak, by what the kernel takes; "
    "the rest is loads, comparisons, selections and waiting for operands",
    "one lane": "CasADi's virtual machine and its C code take one set at a time: at most one lane of a register works",
    "own steps": "solve_ivp, Diffsol and heyoka choose their steps; their operations are not counted",
    "heyoka": "its series runs across the kinks of |y| and |slip|: that is its cost deviation",
}
#: an operation on every chain, a factor and an offset
Operation = Callable[[Emitter, Value, Value, Value], Value]


@dataclass(frozen=True)
class Peak:
    """What a core does at most, doubles per second."""

    multiply_adds: float
    divisions: float


def run(
    sets: int = 256, seconds: float = 1.0, peers: Sequence[Peer] = PEERS
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Time all ways on one core, each for ``seconds`` or once, whichever is longer; the best repetition counts.

    Returns
    -------
    rows
        One per competitor and result: ``name``, ``result``, ``build_seconds``, ``us_per_set`` (one evaluation of all
        tests), ``ns_per_step`` (and lane), ``times_the_kernel`` (how many times longer than the kernel's same
        result), ``cost_deviation`` (relative to the kernel's), for those that do the same steps
        ``fraction_of_peak`` (operations by the most that the core does), for the kernel also ``fraction_of_bound``
        (what its multiply-adds and its divisions would take, each at its own peak, by what it takes); or ``skipped``
        with the reason.
    settings
        The task and the machine.
    """
    task = Task()
    peak = Peak(peak_rate(Emitter.multiply_add), peak_rate(_division))
    simulator = Simulator(task.system, task.experiments, FREE, steps=1)
    ours: dict[str, Callable[[Any], Any]] = {
        "cost": simulator.cost,
        _GAUSS_NEWTON: simulator.gauss_newton,
        "outputs": simulator.simulate,
        "outputs + sensitivities": simulator.sensitivities,
    }
    rows = [_kernel_row(name, evaluate, task, sets, seconds, peak) for name, evaluate in ours.items()]
    own = {entry["result"]: entry for entry in rows}
    for name, result, make, batch in peers:
        timed = partial(_row, make, task, batch, seconds, simulator, own[result])
        found = row({"name": name, "result": result}, timed)
        if name in SAME_STEPS and "times_the_kernel" in found:  # the same operations in another time
            found["fraction_of_peak"] = own[result]["fraction_of_peak"] / found["times_the_kernel"]
        rows.append(found)
    return rows, _settings(task, sets, peak)


def _timed(evaluate: Callable[[Any], Any], p: Any, seconds: float) -> float:
    """Best time of a call, s; every call has other parameters, for results may be kept."""
    best, end = np.inf, time.perf_counter() + seconds
    while best == np.inf or time.perf_counter() < end:
        p = np.nextafter(p, np.inf)
        begin = time.perf_counter()
        evaluate(p)
        best = min(best, time.perf_counter() - begin)
    return best


def _row(
    make: Callable[[Task], Evaluate], task: Task, batch: int, seconds: float, ours: Simulator, own: dict[str, Any]
) -> dict[str, Any]:
    p = task.parameters(batch)
    begin = time.perf_counter()
    evaluate = make(task)
    cost = evaluate(p)
    first = time.perf_counter() - begin
    best = _timed(evaluate, p, seconds)
    expected = ours.cost(p).sum(axis=1)
    us_per_set = best / batch * 1e6
    return {
        "build_seconds": max(first - best, 0.0),
        "us_per_set": us_per_set,
        "ns_per_step": best / batch / task.steps * 1e9,
        "cost_deviation": float(np.max(np.abs(cost - expected) / expected)),
        "times_the_kernel": us_per_set / own["us_per_set"],
    }


def _kernel_row(
    result: str, evaluate: Callable[[Any], Any], task: Task, sets: int, seconds: float, peak: Peak
) -> dict[str, Any]:
    p = task.parameters(sets)
    begin = time.perf_counter()
    evaluate(p)
    first = time.perf_counter() - begin
    best = _timed(evaluate, p, seconds)
    reduce, derivatives = not result.startswith("outputs"), result not in ("cost", "outputs")
    operations, divisions = _operations(task, derivatives, reduce)
    steps = sets * task.steps
    bound = steps * ((operations - divisions) / (2 * peak.multiply_adds) + divisions / peak.divisions)
    return {
        "name": "mofit kernel",
        "result": result,
        "build_seconds": max(first - best, 0.0),
        "us_per_set": best / sets * 1e6,
        "ns_per_step": best / sets / task.steps * 1e9,
        "times_the_kernel": 1.0,
        "fraction_of_peak": steps * operations / best / (2 * peak.multiply_adds),
        "fraction_of_bound": bound / best,
        "divisions": divisions / operations,
    }


def _operations(task: Task, derivatives: bool, reduce: bool) -> tuple[int, int]:
    """Floating point operations of a step, its output and its sums, per lane, and how many of them are divisions.

    A fused multiply-add is two.
    """
    kernel = Kernel(task.system, FREE, RK4, derivatives, reduce)
    split = kernel.sample
    worked = [split.program.nodes[i].op for i in split.live if split.levels[i] == LANE | TIME]
    count = sum(2 if op in (FMA, FMS, FNMA) else op != ca.OP_INPUT for op in worked)
    slopes = kernel.shape.free * derivatives
    # residual and products with the weight, then one multiply-add per sum
    divisions = sum(op in (ca.OP_DIV, ca.OP_INV) for op in worked)
    return count + reduce * (2 + slopes + 2 * kernel.shape.sums), divisions


def _settings(task: Task, sets: int, peak: Peak) -> dict[str, Any]:
    return {
        "model": "maxwell_tyre",
        "free": list(FREE),
        "tests": [experiment.name for experiment in task.experiments],
        "steps": task.steps,
        "sets_per_call": sets,
        "cores": 1,
        "cpu": binding.get_host_cpu_name(),
        "register_doubles": host().width,
        "peak_fma_per_second": peak.multiply_adds,
        "peak_divisions_per_second": peak.divisions,
        **versions("numpy", "scipy", "casadi", "llvmlite", "jax", "numba", "pydiffsol", "heyoka"),
        **EXPLAINED,
    }


def _division(emit: Emitter, value: Value, factor: Value, _: Value) -> Value:
    return emit.builder.fdiv(factor, value)


def peak_rate(operation: Operation, repeats: int = 20, clock: Callable[[], float] = time.perf_counter) -> float:
    """An operation on doubles per second: 16 independent chains of full registers, best of ``repeats``."""
    chains, rounds = 16, 200_000
    emit = Emitter([PTR], host().width, host())
    (data,) = emit.arguments
    factor, offset = emit.constant(0.999999), emit.constant(1e-6)

    def body(_: Value, values: list[Value]) -> list[Value]:
        return [operation(emit, value, factor, offset) for value in values]

    start = [emit.load(data, chain * host().width) for chain in range(chains)]
    for chain, value in enumerate(emit.loop(integer(rounds), start, body)):
        emit.store(value, data, chain * host().width)
    text = emit.text()
    code = compile_entry(text, lambda: text, ctypes.CFUNCTYPE(None, ctypes.c_void_p))
    values = np.ones(chains * host().width)
    best = np.inf
    for _ in range(repeats):
        begin = clock()
        code.entry(values.ctypes.data)
        best = min(best, clock() - begin)
    return rounds * len(values) / best
