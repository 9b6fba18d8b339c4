"""pyPESTO: multi-start L-BFGS-B, then its default sampler, adaptive Metropolis."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from benchmarks.pipelines.by_script import log_posterior
from benchmarks.pipelines.job import Evaluate
from benchmarks.pipelines.peer import FIRST_STEP, MOST, Peer, seeded
from benchmarks.rows import imported
from mofit._typing import FloatArray
from mofit.sampling import effective_size

#: Its documentation starts 100 times.
STARTS = 20
#: Of finite differences, in box widths: a hundredth of the smallest posterior standard deviation.
DIFFERENCE = 1e-6
#: Draws between two looks at the chain.
ROUND = 5000


def search(evaluate: Evaluate, dimension: int, seed: int) -> FloatArray:
    """Multi-start from uniform points, gradients by forward differences; the end of every start."""
    pypesto, optimize = imported("pypesto"), imported("pypesto.optimize")

    def cost(u: FloatArray) -> tuple[float, FloatArray]:
        inward = np.where(u > 0.5, -DIFFERENCE, DIFFERENCE)
        values = -evaluate(np.concatenate([u[None], u + np.diag(inward)]))
        return float(values[0]), (values[1:] - values[0]) / inward

    problem = _problem(pypesto, dimension, fun=cost, grad=True)
    with seeded(seed):
        found = optimize.minimize(problem, optimize.ScipyOptimizer("L-BFGS-B"), n_starts=STARTS, progress_bar=False)
    return np.array([end.x for end in found.optimize_result.list if np.isfinite(end.fval)])


def sample(evaluate: Evaluate, start: FloatArray, seed: int, target: float) -> float:
    """One chain of adaptive Metropolis, looked at every so often; what its Geweke test calls burn-in is dropped."""
    pypesto, sampling = imported("pypesto"), imported("pypesto.sample")
    problem = _problem(pypesto, len(start), fun=lambda u: -float(evaluate(u[None])[0]))
    sampler = sampling.AdaptiveMetropolisSampler({"cov0": FIRST_STEP**2, "show_progress": False})
    effective = 0.0
    with seeded(seed):
        sampler.initialize(problem, start)
        for _ in range(MOST // ROUND):
            sampler.sample(ROUND)
            result = pypesto.Result(problem)
            result.sample_result = sampler.get_samples()
            burn_in = sampling.geweke_test(result)
            effective = float(effective_size(result.sample_result.trace_x[:, burn_in:]).min())
            if effective >= target:
                break
    return effective


def _problem(pypesto: Any, dimension: int, **objective: Any) -> Any:
    logging.getLogger("pypesto").setLevel(logging.ERROR)  # it reports every start
    return pypesto.Problem(pypesto.Objective(**objective), lb=np.zeros(dimension), ub=np.ones(dimension))


PEER = Peer(
    "pyPESTO",
    f"solve_ivp with LSODA at 1e-6; L-BFGS-B from {STARTS} points, finite differences; adaptive Metropolis, one chain, "
    "burn-in by the Geweke test",
    search,
    sample,
    log_posterior,
)
