"""JAX: the equations integrated by diffrax, multi-start L-BFGS-B with its gradients, then numpyro's NUTS."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from benchmarks.nuts import CHAINS, load_jax, logit_factor, make_nuts
from benchmarks.pipelines.job import Evaluate, Task, Test
from benchmarks.pipelines.peer import MOST, Peer
from benchmarks.rows import imported
from mofit._typing import FloatArray
from mofit.sampling import effective_size

#: Of the multi-start, from uniform points.
STARTS = 20
#: Warm-up, and draws of each chain between two looks at the effective number.
WARM_UP, ROUND = 300, 100


def search(evaluate: Evaluate, dimension: int, seed: int) -> FloatArray:
    """SciPy's L-BFGS-B with exact gradients; the end of every start."""

    def cost(u: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = evaluate(u[None])
        return (float(value[0]), gradient[0]) if np.isfinite(value[0]) else (1e12, np.zeros(dimension))

    starts = np.random.default_rng(seed).random((STARTS, dimension))
    box = [(0.0, 1.0)] * dimension
    ends = [
        minimize(cost, start, jac=True, method="L-BFGS-B", bounds=box, options={"maxiter": 1000}) for start in starts
    ]
    return np.array([end.x for end in sorted(ends, key=lambda end: end.fun)])


def sample(evaluate: Evaluate, start: FloatArray, seed: int, target: float) -> float:
    """NUTS over the logits of the unit cube, whitened by the curvature at the start, all chains at once."""
    sampler = make_nuts(evaluate, *logit_factor(start, _spread(evaluate, start)), WARM_UP, ROUND)
    key = load_jax().random.PRNGKey
    first = np.random.default_rng(seed).standard_normal((CHAINS, len(start)))
    draws: list[FloatArray] = []
    effective = 0.0
    while effective < target and len(draws) * CHAINS * ROUND < MOST // 10:
        sampler.run(key(seed + len(draws)), init_params=first)
        sampler.post_warmup_state = sampler.last_state
        draws.append(np.asarray(sampler.get_samples(group_by_chain=True)))
        effective = float(effective_size(np.concatenate(draws, axis=1)).min())
    return effective


def _spread(evaluate: Evaluate, start: FloatArray, step: float = 1e-5) -> FloatArray:
    """A factor (d, d) of the covariance at the start, from differences of the gradient."""
    moves = step * np.eye(len(start))
    _, slopes = evaluate(np.concatenate([start + moves, start - moves]))
    hessian = (slopes[: len(start)] - slopes[len(start) :]) / (2 * step)
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    return vectors / np.sqrt(np.maximum(values, 1.0))  # no wider than the box


def descent(task: Task) -> Evaluate:
    """Negative log posterior (N,) and gradient (N, d) by diffrax: Tsit5, one step per sample, derivatives forward.

    Its adaptive steps take several times as long, reverse derivatives as well. Tests are padded to one length, so that
    all are integrated at once.
    """
    diffrax, jax = imported("diffrax"), load_jax()
    jnp = jax.numpy
    samples = max(len(test.time) for test in task.tests)
    step = float(task.tests[0].time[1])
    pieces = jnp.array([_pieces(test, samples) for test in task.tests])
    force = jnp.array([_padded(test.force, samples) for test in task.tests])
    weight = jnp.array([_padded(test.judged / test.sigma**2, samples) for test in task.tests])
    speeds = jnp.array([(test.speed, test.fictitious) for test in task.tests])
    time = jnp.arange(samples) * step
    lower, upper, logarithmic = jnp.array(task.lower), jnp.array(task.upper), jnp.array(task.logarithmic)
    nominal = jnp.array(task.nominal)
    ratio = jnp.where(logarithmic, upper / jnp.where(logarithmic, lower, 1.0), 1.0)

    def motion(t: Any, state: Any, values: Any, curve: Any, speed: Any) -> tuple[Any, Any]:
        slope, s_max, f_max, c_y, p_y, d_y, c_m, d_m = values
        y, y_m = state
        piece = jnp.clip((t / step).astype(int), 0, samples - 2)
        a, b, c, d = curve[piece]
        dt = t - piece * step
        angle = ((a * dt + b) * dt + c) * dt + d
        transport = jnp.abs(speed[0] * jnp.cos(angle)) + speed[1]
        slip = speed[0] * jnp.sin(angle) / transport
        size = jnp.abs(slip)
        sigma = jnp.minimum(size / s_max, 1)
        tau = jnp.clip((size / s_max - 1) / 2, 0, 1)
        rising = slope / (1 + sigma * (sigma + slope * s_max / f_max - 2))
        falling = f_max * (1 - 0.05 * tau**2 * (3 - 2 * tau)) / jnp.maximum(size, s_max)
        stiffness = jnp.where(size <= s_max, rising, falling)
        held = 0.5 / jnp.maximum(-p_y, 1e-6)
        spring = jnp.clip(y, -held, held)
        inner = c_y * (1 + p_y * jnp.abs(spring)) * spring + c_m * (y - y_m)
        rate = transport * (stiffness * slip - inner) / (transport * d_y + stiffness)
        return jnp.stack([rate, c_m / d_m * (y - y_m)]), inner + d_y * rate

    def squares(values: Any, curve: Any, measured: Any, weights: Any, speed: Any) -> Any:
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, x, _: motion(t, x, values, curve, speed)[0]), diffrax.Tsit5(),
            t0=0.0, t1=time[-1], dt0=step, y0=jnp.zeros(2), saveat=diffrax.SaveAt(t0=True, steps=True),
            stepsize_controller=diffrax.ConstantStepSize(), adjoint=diffrax.ForwardMode(), max_steps=samples - 1,
        )  # fmt: skip
        simulated = jax.vmap(lambda t, x: motion(t, x, values, curve, speed)[1])(time, found.ys)
        return jnp.sum(weights * (simulated - measured) ** 2)

    def value(u: Any) -> Any:
        values = nominal.at[task.free].set(jnp.where(logarithmic, lower * ratio**u, lower + u * (upper - lower)))
        gap = u - task.mean
        each = jax.vmap(squares, (None, 0, 0, 0, 0))(values, pieces, force, weight, speeds)
        total = 0.5 * each.sum() + 0.5 * gap @ task.precision @ gap
        return total, total

    whole = jax.jit(jax.vmap(jax.jacfwd(value, has_aux=True)))

    def evaluate(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        gradient, values = whole(jnp.array(u))
        return np.asarray(values), np.asarray(gradient)

    return evaluate


def _pieces(test: Test, samples: int) -> FloatArray:
    """Polynomials of the spline through the slip angle, (samples - 1, 4); constant after the test's end."""
    curve = CubicSpline(test.time, test.angle).c.T
    rest = np.tile([0.0, 0.0, 0.0, test.angle[-1]], (samples - 1 - len(curve), 1))
    return np.concatenate([curve, rest])


def _padded(signal: FloatArray, samples: int) -> FloatArray:
    return np.concatenate([signal, np.zeros(samples - len(signal))])


PEER = Peer(
    "JAX",
    f"diffrax, Tsit5, one step per sample, derivatives forward; SciPy's L-BFGS-B from {STARTS} points; numpyro's NUTS, "
    f"{CHAINS} chains in step, {WARM_UP} steps of warm-up; every evaluation with gradient",
    search,
    sample,
    descent,
    gradients=True,
)
