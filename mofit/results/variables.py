"""Plain arrays become labelled variables: every one carries its unit and says what it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike, DTypeLike, NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.results.schema import AXES, LEADS, group_at


class Computed(BackendArray):
    """Numbers that are computed whenever they are read, and not kept: those of long records would fill the memory.

    Parameters
    ----------
    compute
        Returns the array.
    shape, dtype
        Of the array.
    """

    def __init__(self, compute: Callable[[], FloatArray], shape: Sequence[int], dtype: DTypeLike = float) -> None:
        self.shape, self.dtype = tuple(shape), np.dtype(dtype)
        self._compute = compute

    def __getitem__(self, key: indexing.ExplicitIndexer) -> FloatArray:
        """Some or all of the numbers, as xarray asks for them."""

        def read(index: tuple[Any, ...]) -> FloatArray:
            return np.asarray(self._compute()[index], dtype=self.dtype)

        found = indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, read)
        return np.asarray(found)


def quantity(dims: str | Sequence[str], values: ArrayLike | Computed, units: str, long_name: str) -> xr.Variable:
    """A variable of the result tree.

    Parameters
    ----------
    dims, values
        Dimensions in the order of the array's axes; numbers in SI units, or strings.
    units, long_name
        SI unit, ``"1"`` without one; and what the variable is, in a few words.
    """
    data = indexing.LazilyIndexedArray(values) if isinstance(values, Computed) else np.asarray(values)
    return xr.Variable(dims, data, {"units": units, "long_name": long_name})


def axis(dim: str, values: ArrayLike) -> xr.Variable:
    """A coordinate: the labels along ``dim``, which says what they are."""
    known = AXES.get(dim) or f"parameter of the stage {dim.removeprefix('parameter_').replace('_', ' ')}"
    return quantity(dim, values, "1", known)


def group_dataset(
    path: str,
    values: Mapping[str, ArrayLike],
    coords: Mapping[str, xr.Variable],
    attributes: Mapping[str, object] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    long_names: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """A group of the result tree, its variables labelled as the schema (`mofit.results.schema`) has them.

    Parameters
    ----------
    path, attributes
        Of the group: ``"/search"``, ``"/modes/m1"``.
    values, coords
        Variables by name, all of them in the schema, and the labels along their dimensions.
    units, long_names
        Of variables for which the schema leaves them to the model.
    """
    group, name = group_at(path)
    variables = {}
    for key, content in values.items():
        known = group.variables[key]
        unit, text = known.units or (units or {})[key], known.long_name or (long_names or {})[key]
        variables[key] = quantity(known.over(name, "output" in coords), content, unit, text)
    return xr.Dataset(variables, coords, attributes)


def draws_dataset(space: ParameterSpace, values: FloatArray) -> xr.Dataset:
    """Posterior draws (chain, draw, d) of the parameters of a space, each a variable of its own as ArviZ wants it."""
    return xr.Dataset(
        {
            p.name: quantity(("chain", "draw"), values[..., i], p.unit, p.description or p.name)
            for i, p in enumerate(space.parameters)
        },
        draw_axes(values.shape),
    )


def draw_axes(shape: Sequence[int]) -> dict[str, xr.Variable]:
    """Coordinates of variables over (chain, draw, …)."""
    return {"chain": axis("chain", range(shape[0])), "draw": axis("draw", range(shape[1]))}


def parameter_axis(names: Iterable[str], units: Iterable[str], dim: str = "parameter") -> dict[str, xr.Variable]:
    """Coordinates of variables over parameters: the names, and beside each its SI unit (see `OWN_UNIT`)."""
    return {dim: axis(dim, list(names)), "unit": quantity(dim, list(units), "1", "SI unit of the parameter")}


@dataclass(frozen=True)
class Signal:
    """One signal of one test, or many of it: at draws of a posterior, at fireflies.

    Lengths differ between tests, so the time dimension is ``time_<test>``.

    Parameters
    ----------
    test
        Name of the test.
    time, values
        Shape (n,), s; and (n,), (chain, draw, n) for draws from a posterior, or (firefly, n).
    units, long_name
        As in `quantity`.
    outputs
        Whether the last axis of the values is that of the outputs.
    """

    test: str
    time: ArrayLike
    values: ArrayLike | Computed
    units: str
    long_name: str
    outputs: bool = False


def signal_dataset(signals: Mapping[str, Signal]) -> xr.Dataset:
    """Signals of several tests by variable (``sine_1``, ``sine_1_slip_angle``), each over its own ``time_<test>``."""
    variables, coords = {}, {}
    for name, signal in signals.items():
        time = f"time_{signal.test}"
        last = ("output",) * signal.outputs
        lead = LEADS[np.ndim(signal.values) - 1 - len(last)]
        variables[name] = quantity((*lead, time, *last), signal.values, signal.units, signal.long_name)
        # an index that shares the measured time: xarray would copy it for every group
        shared = pd.Index(signal.time, copy=False)
        coords[time] = xr.Variable(time, shared, {"units": "s", "long_name": f"time of {signal.test}"})
    return xr.Dataset(variables, coords)


def predictive_places(draws: tuple[int, int], predicted: tuple[int, int]) -> tuple[NDArray[np.intp], ...]:
    """Chain and draw, to index with, of the posterior draws that a posterior predictive is simulated at: evenly spread.

    Parameters
    ----------
    draws, predicted
        Numbers of chains and draws of the posterior, and of the posterior predictive.
    """
    return np.ix_(*(np.linspace(0, n - 1, few).astype(int) for n, few in zip(draws, predicted, strict=True)))
