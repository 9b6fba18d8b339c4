"""The script that people write: the tyre in plain Python and solve_ivp, differential evolution, emcee.

Its simulator is also that of the peers that bring none of their own. It is as fast as plain Python allows: scalars of
`math` instead of arrays of one element, and the spline through the measured input unrolled into its polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import emcee
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import differential_evolution

from benchmarks.pipelines.job import Evaluate, Task, Test
from benchmarks.pipelines.peer import FIRST_STEP, MOST, Peer
from mofit._typing import FloatArray
from mofit.sampling import autocorrelation_time

#: At 1e-5 the log posterior near the minimum is off by more than a nat, at 1e-6 by a hundredth.
RTOL, ATOL = 1e-6, 1e-9


def log_posterior(task: Task) -> Callable[[FloatArray], FloatArray]:
    """Log posterior (N,) at points (N, d) of the unit cube, one after the other; -inf outside or on failure."""
    simulated = [(test, _simulator(test)) for test in task.tests]

    def at(u: FloatArray) -> float:
        if np.any(u < 0) or np.any(u > 1):
            return -np.inf
        values = [float(value) for value in task.values(u)]
        total = task.log_prior(u)
        try:
            for test, simulate in simulated:
                gap = (simulate(values) - test.force)[test.judged]
                total -= 0.5 * float(gap @ gap) / test.sigma**2
        except ArithmeticError:
            return -np.inf
        return total if math.isfinite(total) else -np.inf

    return lambda points: np.array([at(u) for u in points])


def _simulator(test: Test) -> Callable[[list[float]], FloatArray]:
    """Lateral force (n,) of a test from the values of the parameters."""
    step, last = float(test.time[1]), len(test.time) - 2
    pieces = [tuple(map(float, piece)) for piece in CubicSpline(test.time, test.angle).c.T]
    speed, fictitious = test.speed, test.fictitious

    def simulate(values: list[float]) -> FloatArray:
        slope, s_max, f_max, c_y, p_y, d_y, c_m, d_m = values
        held = 0.5 / max(-p_y, 1e-6)

        def motion(t: float, y: float, y_m: float) -> tuple[float, float, float]:
            piece = min(int(t / step), last)
            a, b, c, d = pieces[piece]
            dt = t - piece * step
            angle = ((a * dt + b) * dt + c) * dt + d
            transport = abs(speed * math.cos(angle)) + fictitious
            slip = speed * math.sin(angle) / transport
            sigma = abs(slip) / s_max
            if sigma <= 1:
                stiffness = slope / (1 + sigma * (sigma + slope * s_max / f_max - 2))
            else:
                tau = min((sigma - 1) / 2, 1)
                stiffness = f_max * (1 - 0.05 * tau * tau * (3 - 2 * tau)) / abs(slip)
            spring = max(-held, min(y, held))
            inner = c_y * (1 + p_y * abs(spring)) * spring + c_m * (y - y_m)
            rate = transport * (stiffness * slip - inner) / (transport * d_y + stiffness)
            return rate, c_m / d_m * (y - y_m), inner + d_y * rate

        found = solve_ivp(
            lambda t, x: motion(t, x[0], x[1])[:2], (0.0, test.time[-1]), (0.0, 0.0), "LSODA", test.time,
            rtol=RTOL, atol=ATOL,
        )  # fmt: skip
        if not found.success:
            raise ArithmeticError(found.message)
        states = zip(test.time.tolist(), *found.y.tolist(), strict=True)
        return np.array([motion(*state)[2] for state in states])

    return simulate


#: As in emcee's examples, and at least twice the dimension.
WALKERS = 32
#: Steps between two looks at the autocorrelation time, and how many times it a chain must be long (emcee's tutorial).
ROUND, MULTIPLE = 500, 50


def search(evaluate: Evaluate, dimension: int, seed: int) -> FloatArray:
    """SciPy's differential evolution with its default settings, its result polished: one minimum."""

    def cost(x: FloatArray) -> Any:
        return -evaluate(x.T)

    box = [(0.0, 1.0)] * dimension
    return differential_evolution(cost, box, rng=seed, updating="deferred", vectorized=True).x[None]


def sample(evaluate: Evaluate, start: FloatArray, seed: int, target: float) -> float:
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
