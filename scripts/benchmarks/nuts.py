"""numpyro's NUTS on a posterior that is evaluated outside JAX, in batches and with its gradient."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.rows import imported
from mofit._typing import FloatArray

CHAINS = 4


def load_jax() -> Any:
    """JAX in double precision."""
    jax = imported("jax")
    jax.config.update("jax_enable_x64", True)
    return jax


def logit_factor(centre: FloatArray, factor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Logits of a point (d,) of the unit cube, and a factor (d, d) of the covariance there, carried over to logits."""
    inside = np.clip(centre, 1e-3, 1 - 1e-3)
    return np.log(inside / (1 - inside)), factor / (inside * (1 - inside))[:, None]


def make_nuts(
    evaluate: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    middle: FloatArray,
    factor: FloatArray,
    warm_up: int,
    draws: int,
) -> Any:
    """The sampler: four chains in step over the logits of the unit cube, whitened; dense mass matrix.

    Parameters
    ----------
    evaluate
        Points (N, d) to negative log posterior (N,), not finite where it fails, and gradient (N, d).
    middle, factor
        Logits are ``middle + factor @ white``.
    warm_up, draws
        Of every chain.
    """
    infer, jax = imported("numpyro.infer"), load_jax()

    def called(points: Any) -> tuple[FloatArray, FloatArray]:
        value, gradient = evaluate(np.asarray(points, dtype=float).reshape(-1, len(middle)))
        good = np.isfinite(value)
        value, gradient = np.where(good, value, np.inf), np.where(good[:, None], gradient, 0.0)
        return value.reshape(np.shape(points)[:-1]), gradient.reshape(np.shape(points))

    def both(point: Any) -> Any:
        shapes = jax.ShapeDtypeStruct(point.shape[:-1], float), jax.ShapeDtypeStruct(point.shape, float)
        return jax.pure_callback(called, shapes, point, vmap_method="expand_dims")

    potential = jax.custom_vjp(lambda point: both(point)[0])
    potential.defvjp(both, lambda gradient, slope: (slope[..., None] * gradient,))

    def energy(white: Any) -> Any:
        logits = middle + factor @ white
        log_volume = jax.numpy.sum(jax.nn.log_sigmoid(logits) + jax.nn.log_sigmoid(-logits))
        return potential(jax.nn.sigmoid(logits)) - log_volume

    return infer.MCMC(
        infer.NUTS(potential_fn=energy, dense_mass=True),
        num_warmup=warm_up,
        num_samples=draws,
        num_chains=CHAINS,
        chain_method="vectorized",
        progress_bar=False,
    )
