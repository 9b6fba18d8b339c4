"""The script that people write: solve_ivp, differential evolution, emcee."""

from __future__ import annotations

from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from mofit.bench.pipelines.fast import Evaluate
from mofit.bench.pipelines.own_equations import log_posterior
from mofit.bench.pipelines.peer import FIRST_STEP, MOST, Peer
from mofit.sample import autocorrelation_time

Array = NDArray[np.float64]

#: As in emcee's examples, and at least twice the dimension.
WALKERS = 32
#: Steps between two looks at the autocorrelation time, and how many times it a chain must be long (emcee's tutorial).
ROUND, MULTIPLE = 500, 50


def search(evaluate: Evaluate, dimension: int, seed: int) -> Array:
    """SciPy's differential evolution with its default settings, its result polished: one minimum."""

    def cost(x: Array) -> Any:
        return -evaluate(x.T)

    box = [(0.0, 1.0)] * dimension
    return differential_evolution(cost, box, rng=seed, updating="deferred", vectorized=True).x[None]


def sample(evaluate: Evaluate, start: Array, seed: int, target: float) -> float:
    """One ensemble with emcee's default move, looked at every so often until it is long enough."""
    rng = np.random.default_rng(seed)
    sampler = emcee.EnsembleSampler(WALKERS, len(start), evaluate, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    state = np.clip(start + FIRST_STEP * rng.standard_normal((WALKERS, len(start))), 0.0, 1.0)
    effective = 0.0
    for steps in range(ROUND, MOST // WALKERS, ROUND):
        state = sampler.run_mcmc(state, ROUND)
        later = sampler.get_chain()[steps // 2 :]
        tau = float(autocorrelation_time(later).max())
        effective = later.shape[0] * WALKERS / tau
        if effective >= target and steps > MULTIPLE * tau:
            break
    return effective


PEER = Peer(
    "script",
    "solve_ivp with LSODA at 1e-6; SciPy's differential_evolution, default settings, polished; emcee, default move, "
    f"{WALKERS} walkers, half of the chain dropped",
    search,
    sample,
    log_posterior,
)
