"""The kernel beside other ways to integrate the paper's model and differentiate the result, in one run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from llvmlite import binding

from mofit.bench import competitors
from mofit.bench.competitors import Absent, Evaluate
from mofit.bench.peak import peak_fma_rate
from mofit.bench.task import FREE, Task
from mofit.bench.versions import versions
from mofit.kernel import Simulator
from mofit.kernel.machine import host
from mofit.kernel.program import FMA, FMS, FNMA, LANE, TIME
from mofit.kernel.steps import RK4
from mofit.kernel.variant import Variant

_GAUSS_NEWTON = "residual + gradient + Gauss-Newton"
#: name, what it gives, how it is made, parameter sets per call
_OTHERS: tuple[tuple[str, str, Callable[[Task], Evaluate], int], ...] = (
    ("scipy solve_ivp (RK45, 1e-6)", "cost", competitors.scipy_cost, 1),
    ("CasADi virtual machine", _GAUSS_NEWTON, competitors.casadi_machine, 1),
    ("CasADi C code, gcc -O3", _GAUSS_NEWTON, competitors.casadi_compiled, 1),
    ("JAX (jit, vmap, scan)", _GAUSS_NEWTON, competitors.jax_batched, 64),
)


def run(sets: int = 256, seconds: float = 1.0) -> tuple[list[dict[str, Any]], dict[str, Any]]:
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
    simulator = Simulator(task.system, task.drives, FREE, steps=1)
    ours: dict[str, Callable[[Any], Any]] = {
        "cost": simulator.cost,
        _GAUSS_NEWTON: simulator.gauss_newton,
        "outputs": simulator.simulate,
        "outputs + sensitivities": simulator.sensitivities,
    }
    rows = [_kernel_row(name, evaluate, task, sets, seconds, peak) for name, evaluate in ours.items()]
    own = {row["result"]: row["us_per_set"] for row in rows}
    for name, result, make, batch in _OTHERS:
        try:
            row = _row(name, result, make, task, batch, seconds, simulator)
        except Absent as reason:
            row = {"name": name, "result": result, "skipped": str(reason)}
        else:
            row["times_the_kernel"] = row["us_per_set"] / own[result]
        rows.append(row)
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
    name: str, result: str, make: Callable[[Task], Evaluate], task: Task, batch: int, seconds: float, ours: Simulator
) -> dict[str, Any]:
    p = task.parameters(batch)
    begin = time.perf_counter()
    evaluate = make(task)
    cost = evaluate(p)
    first = time.perf_counter() - begin
    best = _timed(evaluate, p, seconds)
    own = ours.cost(p).sum(axis=1)
    return {
        "name": name,
        "result": result,
        "build_seconds": max(first - best, 0.0),
        "us_per_set": best / batch * 1e6,
        "ns_per_step": best / batch / task.steps * 1e9,
        "cost_deviation": float(np.max(np.abs(cost - own) / own)),
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
    variant = Variant(task.system, FREE, RK4, derivatives, reduce, spread=False)
    split = variant.sample
    worked = [split.program.nodes[i].op for i in split.live if split.levels[i] == LANE | TIME]
    count = sum(2 if op in (FMA, FMS, FNMA) else op != ca.OP_INPUT for op in worked)
    slopes = variant.shape.free * derivatives
    # residual and products with the weight, then one multiply-add per sum
    return count + reduce * (2 + slopes + 2 * variant.shape.sums)


def _settings(task: Task, sets: int, peak: float) -> dict[str, Any]:
    return {
        "model": "maxwell_tyre",
        "free": list(FREE),
        "tests": [drive.name for drive in task.drives],
        "steps": task.steps,
        "sets_per_call": sets,
        "cores": 1,
        "cpu": binding.get_host_cpu_name(),
        "register_doubles": host().width,
        "peak_fma_per_second": peak,
        **versions("numpy", "scipy", "casadi", "llvmlite", "jax"),
    }
