"""Where in the parameter space tests are judged: at stated values and around them, or over the posterior of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mofit.errors import Fault, did_you_mean, raise_errors
from mofit.parameters import ParameterSpace
from mofit.sobol import sobol

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Parameter sets that a verdict is judged at.
POINTS = 16
#: Half the width, as a share of the bounds' box, of the box around stated values: how little is known beforehand.
AROUND = 0.15


def at_values(space: ParameterSpace, values: Array, at: Mapping[str, float]) -> Array:
    """The values (d,) with others for the parameters that are named.

    Raises
    ------
    InputError
        For unknown names, and values outside their bounds.
    """
    faults = []
    changed = values.copy()
    for name, value in at.items():
        if name not in space.names:
            faults.append(Fault(f"--at {name}", "the model has no such parameter", did_you_mean(name, space.names)))
            continue
        own = space[name]
        if not own.lower <= value <= own.upper:
            bounds = f"[{own.lower:g}, {own.upper:g}] {own.unit}"
            faults.append(Fault(f"--at {name}", f"{value:g} lies outside {bounds}", "Give a value inside"))
        changed[space.index(name)] = value
    raise_errors(faults)
    return changed


def around(space: ParameterSpace, values: Array, free: tuple[str, ...], count: int, seed: int) -> Array:
    """Values (d,) first, then scrambled Sobol points in a box around them, (count, d); only ``free`` ones vary."""
    if count == 1 or not free:
        return values[None]
    size = 1 << (count - 1).bit_length()
    scattered = sobol(len(free), seed).random(size)[:count]
    unit = np.repeat(space.to_unit(values)[None], count, axis=0)
    places = [space.index(name) for name in free]
    unit[1:, places] += AROUND * (2 * scattered[1:] - 1)
    moved = space.from_unit(np.clip(unit, 0.0, 1.0))
    found = np.repeat(values[None], count, axis=0)
    found[1:, places] = moved[1:, places]
    return found


def of_run(tree: xr.DataTree, space: ParameterSpace, values: Array, count: int, seed: int) -> Array:
    """Posterior median and posterior draws (count, d) of a run's best mode; parameters it lacks keep their values.

    Raises
    ------
    InputError
        If none of the model's parameters was sampled in the run.
    """
    modes = tree["clusters"].children
    best = max(modes.values(), key=lambda node: float(node.attrs["weight"]))
    posterior = best.children.get("posterior")
    draws = {
        name: np.asarray(posterior[name].values, dtype=float).ravel()
        for name in space.names
        if posterior is not None and name in posterior.data_vars
    }
    raise_errors(
        [Fault("--run", "it holds no posterior of this model's parameters", "Name a run of the same model")]
        if not draws
        else []
    )
    total = len(next(iter(draws.values())))
    chosen = np.random.default_rng(seed).integers(total, size=count)
    found = np.repeat(values[None], count, axis=0)
    for name, own in draws.items():
        column = np.append(np.median(own), own[chosen[1:]])
        found[:, space.index(name)] = np.clip(column, space[name].lower, space[name].upper)
    return found
