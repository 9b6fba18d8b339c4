"""The kernel beside other ways to integrate the paper's model and differentiate the result, in one run."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from llvmlite import binding, ir

from benchmarks import kernel_peers
from benchmarks.kernel_peers import FREE, Evaluate, Task
from benchmarks.rows import row
from mofit.simulation import Simulator
from mofit.simulation.compiler.emit import PTR, Emitter
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
)


def run(
    sets: int = 256, seconds: float = 1.0, peers: Sequence[Peer] = PEERS
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Time all ways on one core, each for ``seconds`` or once, whichever is longer; the best repetition counts.

    Returns
    -------
    rows
        One per competitor and result: ``name``, ``result``, ``build_seconds``, ``us_per_set`` (one evaluation of all
        tests), ``ns_per_step`` (and lane), ``times_the_kernel`` (how many times longer than the kernel's same
        result), ``cost_deviation`` (relative to the kernel's), for the kernel also ``fraction_of_peak``; or
        ``skipped`` with the reason.
    settings
        The task and the machine.
    """
    task = Task()
    peak = peak_fma_rate()
    simulator = Simulator(task.system, task.experiments, FREE, steps=1)
    ours: dict[str, Callable[[Any], Any]] = {
        "cost": simulator.cost,
        _GAUSS_NEWTON: simulator.gauss_newton,
        "outputs": simulator.simulate,
        "outputs + sensitivities": simulator.sensitivities,
    }
    rows = [_kernel_row(name, evaluate, task, sets, seconds, peak) for name, evaluate in ours.items()]
    own = {entry["result"]: entry["us_per_set"] for entry in rows}
    for name, result, make, batch in peers:
        timed = partial(_row, make, task, batch, seconds, simulator, own[result])
        rows.append(row({"name": name, "result": result}, timed))
    return rows, _settings(task, sets, peak)


def _timed(evaluate: Callable[[Any], Any], p: Any, seconds: float) -> float:
    """Best time of a call, s."""
    best, end = np.inf, time.perf_counter() + seconds
    while best == np.inf or time.perf_counter() < end:
        begin = time.perf_counter()
        evaluate(p)
        best = min(best, time.perf_counter() - begin)
    return best


def _row(
    make: Callable[[Task], Evaluate], task: Task, batch: int, seconds: float, ours: Simulator, own: float
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
        "times_the_kernel": us_per_set / own,
    }


def _kernel_row(
    result: str, evaluate: Callable[[Any], Any], task: Task, sets: int, seconds: float, peak: float
) -> dict[str, Any]:
    p = task.parameters(sets)
    begin = time.perf_counter()
    evaluate(p)
    first = time.perf_counter() - begin
    best = _timed(evaluate, p, seconds)
    reduce, derivatives = not result.startswith("outputs"), result not in ("cost", "outputs")
    rate = sets * task.steps * _operations(task, derivatives, reduce) / best
    return {
        "name": "mofit kernel",
        "result": result,
        "build_seconds": max(first - best, 0.0),
        "us_per_set": best / sets * 1e6,
        "ns_per_step": best / sets / task.steps * 1e9,
        "times_the_kernel": 1.0,
        "fraction_of_peak": rate / (2 * peak),
    }


def _operations(task: Task, derivatives: bool, reduce: bool) -> int:
    """Floating point operations of a step, its output and its sums, per lane; a fused multiply-add is two."""
    kernel = Kernel(task.system, FREE, RK4, derivatives, reduce)
    split = kernel.sample
    worked = [split.program.nodes[i].op for i in split.live if split.levels[i] == LANE | TIME]
    count = sum(2 if op in (FMA, FMS, FNMA) else op != ca.OP_INPUT for op in worked)
    slopes = kernel.shape.free * derivatives
    # residual and products with the weight, then one multiply-add per sum
    return count + reduce * (2 + slopes + 2 * kernel.shape.sums)


def _settings(task: Task, sets: int, peak: float) -> dict[str, Any]:
    return {
        "model": "maxwell_tyre",
        "free": list(FREE),
        "tests": [experiment.name for experiment in task.experiments],
        "steps": task.steps,
        "sets_per_call": sets,
        "cores": 1,
        "cpu": binding.get_host_cpu_name(),
        "register_doubles": host().width,
        "peak_fma_per_second": peak,
        **versions("numpy", "scipy", "casadi", "llvmlite", "jax"),
    }


def peak_fma_rate(repeats: int = 20) -> float:
    """Fused multiply-adds on doubles per second: 16 independent chains of full registers, best of ``repeats``."""
    chains, rounds = 16, 200_000
    emit = Emitter([PTR], host().width, host().fma)
    (data,) = emit.run.args
    factor, offset = emit.constant(0.999999), emit.constant(1e-6)

    def body(_: ir.Value, values: list[ir.Value]) -> list[ir.Value]:
        return [emit.multiply_add(value, factor, offset) for value in values]

    start = [emit.load(data, chain * host().width) for chain in range(chains)]
    for chain, value in enumerate(emit.loop(emit.integer(rounds), start, body)):
        emit.store(value, data, chain * host().width)
    text = emit.text()
    code = compile_entry(text, lambda: text, (), ctypes.CFUNCTYPE(None, ctypes.c_void_p))
    values = np.ones(chains * host().width)
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        code.entry(values.ctypes.data)
        best = min(best, time.perf_counter() - begin)
    return rounds * len(values) / best
