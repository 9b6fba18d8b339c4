"""PINTS: CMA-ES from several points, then Haario-Bardenet adaptive Metropolis."""

from __future__ import annotations

import numpy as np

from benchmarks.pipelines.by_script import log_posterior
from benchmarks.pipelines.job import Evaluate
from benchmarks.pipelines.peer import FIRST_STEP, MOST, Peer, seeded
from benchmarks.rows import imported
from mofit._typing import FloatArray
from mofit.sampling import effective_size

#: Runs of CMA-ES; its first step, in box widths; and when a run stops: its best value the same to a hundredth of a nat
#: for so many iterations (the default of `OptimisationController`, 200 iterations to 1e-11, takes longer).
RUNS, SIGMA, UNCHANGED, CHANGE, MOST_ITERATIONS = 5, 0.2, 50, 1e-2, 3000
#: Chains, iterations before they adapt (the default of `MCMCController`), and iterations between two looks at them.
CHAINS, INITIAL, ROUND = 4, 200, 2000


def search(evaluate: Evaluate, dimension: int, seed: int) -> FloatArray:
    """CMA-ES from uniform points, asked and told; the best point of every run."""
    pints = imported("pints")
    box = pints.RectangularBoundaries(np.zeros(dimension), np.ones(dimension))
    rng, ends = np.random.default_rng(seed), []
    with seeded(seed):
        for _ in range(RUNS):
            optimiser = pints.CMAES(rng.random(dimension), np.full(dimension, SIGMA), box)
            best, since = np.inf, 0
            for _ in range(MOST_ITERATIONS):
                optimiser.tell(-evaluate(np.array(optimiser.ask())))
                if optimiser.f_best() < best - CHANGE:
                    best, since = optimiser.f_best(), 0
                else:
                    since += 1
                if since >= UNCHANGED or optimiser.stop():
                    break
            ends.append((optimiser.f_best(), np.array(optimiser.x_best())))
    return np.array([point for _, point in sorted(ends, key=lambda end: end[0])])


def sample(evaluate: Evaluate, start: FloatArray, seed: int, target: float) -> float:
    """Four adaptive chains, asked and told; half of each is dropped."""
    pints = imported("pints")
    first = np.full(len(start), FIRST_STEP**2)
    chains = [pints.HaarioBardenetACMC(start, first) for _ in range(CHAINS)]
    draws: list[FloatArray] = []
    effective = 0.0
    for chain in chains:
        chain.set_initial_phase(True)
    with seeded(seed):
        while len(draws) * CHAINS < MOST:
            if len(draws) == INITIAL:
                for chain in chains:
                    chain.set_initial_phase(False)
            values = evaluate(np.array([chain.ask() for chain in chains]))
            draws.append(np.array([chain.tell(value)[0] for chain, value in zip(chains, values, strict=True)]))
            if len(draws) % ROUND == 0:
                effective = float(effective_size(np.stack(draws[len(draws) // 2 :], axis=1)).min())
                if effective >= target:
                    break
    return effective


PEER = Peer(
    "PINTS",
    f"solve_ivp with LSODA at 1e-6; CMA-ES from {RUNS} points; Haario-Bardenet adaptive Metropolis, {CHAINS} chains, "
    "half of each dropped",
    search,
    sample,
    log_posterior,
)
