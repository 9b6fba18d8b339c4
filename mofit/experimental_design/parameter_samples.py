"""Parameter samples at which tests are evaluated: a box around reference values, or the posterior of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.parameters import ParameterSpace
from mofit.prediction.draws import posterior_draws
from mofit.results import parameter_layout

if TYPE_CHECKING:
    import xarray as xr

#: Half the width of the box around reference values, as a share of the bounds: how uncertain they are beforehand.
HALF_WIDTH = 0.15
#: Draws from the Laplace approximation, whose median is the first sample.
LAPLACE_DRAWS = 1000


def reference_values(space: ParameterSpace, values: FloatArray, at: Mapping[str, float]) -> FloatArray:
    """The values (d,) with those of ``at`` in place of the parameters that it names.

    Raises
    ------
    InputError
        For unknown names, and values outside their bounds.
    """
    issues = []
    changed = values.copy()
    for name, value in at.items():
        if name not in space.names:
            issues.append(Issue(f"--at {name}", "the model has no such parameter", did_you_mean(name, space.names)))
            continue
        own = space[name]
        if not own.lower <= value <= own.upper:
            bounds = f"[{own.lower:g}, {own.upper:g}] {own.unit}"
            issues.append(Issue(f"--at {name}", f"{value:g} lies outside {bounds}", "Give a value inside"))
        changed[space.index(name)] = value
    raise_errors(issues)
    return changed


def box_samples(space: ParameterSpace, values: FloatArray, free: tuple[str, ...], count: int, seed: int) -> FloatArray:
    """Values (d,) first, then scrambled Sobol points in a box around them, (count, d); only ``free`` ones vary."""
    from scipy.stats import qmc  # late: its import takes half a second

    if count == 1 or not free:
        return values[None]
    size = 1 << (count - 1).bit_length()
    scattered = qmc.Sobol(len(free), rng=seed).random(size)[:count]
    unit = np.repeat(space.to_unit(values)[None], count, axis=0)
    places = [space.index(name) for name in free]
    unit[1:, places] += HALF_WIDTH * (2 * scattered[1:] - 1)
    moved = space.from_unit(np.clip(unit, 0.0, 1.0))
    found = np.repeat(values[None], count, axis=0)
    found[1:, places] = moved[1:, places]
    return found


def posterior_samples(
    tree: xr.DataTree, space: ParameterSpace, values: FloatArray, count: int, seed: int
) -> FloatArray:
    """Posterior median and posterior draws (count, d) of a run's best mode; parameters it lacks keep their values.

    Of a run with one mode that was not sampled they are those of the Laplace approximation.

    Raises
    ------
    InputError
        If the run knows none of the model's parameters.
    """
    modes = tree["modes"].children
    best = max(modes.values(), key=lambda node: float(node.attrs["probability"]))
    posterior = best.children.get("posterior")
    known: Mapping[str, FloatArray] = {}
    if posterior is not None:
        known = {str(name): np.asarray(own.values, dtype=float).ravel() for name, own in posterior.data_vars.items()}
    elif len(modes) == 1 and "parameters" in tree.children:
        names = parameter_layout(tree).space.names
        known = dict(zip(names, posterior_draws(tree, LAPLACE_DRAWS, seed).T, strict=True))
    draws = {name: known[name] for name in space.names if name in known}
    if not draws:
        raise InputError.of("--run", "it holds no posterior of this model's parameters", "Name a run of the same model")
    total = len(next(iter(draws.values())))
    chosen = np.random.default_rng(seed).integers(total, size=count)
    found = np.repeat(values[None], count, axis=0)
    for name, own in draws.items():
        column = np.append(np.median(own), own[chosen[1:]])
        found[:, space.index(name)] = np.clip(column, space[name].lower, space[name].upper)
    return found
