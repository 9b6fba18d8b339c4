"""Draws of the parameters of a run, from all modes by their probability."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.results import parameter_layout


def posterior_draws(tree: xr.DataTree, count: int, seed: int) -> FloatArray:
    """Draws of the free parameters in SI units, (count, d), in the order of the tree and shuffled.

    Every mode has as many as its probability asks for. They are posterior draws where the mode was sampled, else draws
    from the Laplace approximation, cut at the bounds.
    """
    rng, space = np.random.default_rng(seed), parameter_layout(tree).space
    modes = list(tree["modes"].children.values())
    shares = np.array([float(mode.attrs["probability"]) for mode in modes])
    if not np.all(np.isfinite(shares)) or not shares.sum() > 0:
        shares = np.eye(len(modes))[0]
    ends = np.round(np.cumsum(shares) / shares.sum() * count).astype(int)
    numbers = np.diff(ends, prepend=0)
    parts = [_of_mode(mode, space, int(number), rng) for mode, number in zip(modes, numbers, strict=True)]
    return np.asarray(rng.permutation(np.concatenate(parts)))


def _of_mode(mode: xr.DataTree, space: ParameterSpace, count: int, rng: np.random.Generator) -> FloatArray:
    if "posterior" not in mode.children:
        return _laplace(mode.dataset, space, count, rng)
    posterior = mode["posterior"].dataset
    whole = np.stack([posterior[name].values.ravel() for name in space.names], axis=-1)
    chosen = rng.choice(len(whole), count, replace=count > len(whole))
    return np.asarray(whole[chosen], dtype=float)


def _laplace(mode: xr.Dataset, space: ParameterSpace, count: int, rng: np.random.Generator) -> FloatArray:
    value = np.asarray(mode["value"].values, dtype=float)
    sd = mode["laplace_sd"].values / space.derivative(value)
    root = np.linalg.cholesky(mode["laplace_correlation"].values + 1e-12 * np.eye(len(value)))
    moved = rng.standard_normal((count, len(value))) @ root.T * sd
    return space.from_unit(np.clip(space.to_unit(value) + moved, 0.0, 1.0))
