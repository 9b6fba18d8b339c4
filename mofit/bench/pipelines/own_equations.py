"""The tyre in plain Python, integrated by SciPy: the simulator of the peers that bring none of their own.

Made as quick as plain Python allows: scalars of `math` instead of arrays of one element, and the spline through the
measured input unrolled into its polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from mofit.bench.pipelines.task import Task, Test

Array = NDArray[np.float64]

#: At 1e-5 the log posterior near the minimum is off by more than a nat, at 1e-6 by a hundredth.
RTOL, ATOL = 1e-6, 1e-9


def log_posterior(task: Task) -> Callable[[Array], Array]:
    """Log posterior (N,) at points (N, d) of the unit cube, one after the other; -inf outside or on failure."""
    simulated = [(test, _simulator(test)) for test in task.tests]

    def at(u: Array) -> float:
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


def _simulator(test: Test) -> Callable[[list[float]], Array]:
    """Lateral force (n,) of a test from the values of the parameters."""
    step, last = float(test.time[1]), len(test.time) - 2
    pieces = [tuple(map(float, piece)) for piece in CubicSpline(test.time, test.angle).c.T]
    speed, fictitious = test.speed, test.fictitious

    def simulate(values: list[float]) -> Array:
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
