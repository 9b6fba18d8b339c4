"""Values of parameters with a scope in a record that was not identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.parameters import PER_CAMPAIGN, PER_TEST, Parameter, ParameterSpace
from mofit.problem.pooling import mean_name, spread_name
from mofit.simulation.scopes import Scopes

Source = Literal["identified", "fitted", "pooled", "mean", "nominal"]


@dataclass(frozen=True)
class ScopedValue:
    """A scoped parameter in one record: where its value comes from, and value and standard deviation if known."""

    parameter: Parameter
    source: Source
    value: float
    sd: float

    def draws(self, known: Mapping[str, FloatArray], count: int, rng: np.random.Generator) -> FloatArray:
        """Values (count,) within the range of the parameter; ``known`` are draws of the campaign's parameters.

        One that is fitted has its nominal value.
        """
        own = self.parameter
        if self.source == "fitted":
            return np.full(count, own.nominal)
        normal = rng.standard_normal(count)
        if self.source != "pooled":
            return np.clip(self.value + self.sd * normal, own.lower, own.upper)
        mean, spread = known[mean_name(own.name)], known[spread_name(own.name)]
        values = mean * np.exp(spread * normal) if own.scale == "log" else mean + spread * normal
        return np.clip(values, own.lower, own.upper)


def scoped_parameters(
    parameters: Sequence[Parameter], configuration: Mapping[str, Any], known: Sequence[str]
) -> tuple[Parameter, ...]:
    """Parameters of a model with a scope, as the run's configuration has it; those ``known`` have a value already.

    Their ranges are wide: they are fitted, not searched. Bounds that were asked for stay.
    """
    scopes, bounds = configuration.get("scopes", {}), configuration.get("bounds", {})
    pooled = configuration.get("pooled", ())
    found = []
    for parameter in parameters:
        one = parameter.scoped(scopes.get(parameter.name), parameter.name in pooled)
        if one.name in known or one.per == PER_CAMPAIGN:
            continue
        if one.name in bounds:
            (one,) = ParameterSpace((one,)).with_bounds(one.name, *bounds[one.name]).parameters
        else:
            one = one.wider()
        found.append(one)
    return tuple(found)


def scoped_values(
    tree: xr.DataTree, parameters: Sequence[Parameter], measurement: Measurement, measured: bool
) -> list[ScopedValue]:
    """Where the scoped values of a record come from.

    The value that was identified under the record's condition; else one that is fitted to the record, if its output was
    measured; else draws from the normal of a pooled parameter; else the mean over the identified tests, with their
    spread; else the nominal value.

    Raises
    ------
    InputError
        If the record lacks a condition that a parameter belongs to.
    """
    labels = Scopes.of(ParameterSpace(tuple(parameters)), [measurement]).labels[measurement.name]
    found = []
    for parameter, label in zip(parameters, labels, strict=True):
        known = _identified(tree, parameter.name)
        if label in known and parameter.per != PER_TEST:
            found.append(ScopedValue(parameter, "identified", *known[label]))
        elif measured:
            found.append(ScopedValue(parameter, "fitted", np.nan, 0.0))
        elif parameter.pooled:
            found.append(ScopedValue(parameter, "pooled", np.nan, np.nan))
        elif known:
            values = np.array([value for value, _ in known.values()])
            spread = float(values.std(ddof=1)) if len(values) > 1 else next(iter(known.values()))[1]
            found.append(ScopedValue(parameter, "mean", float(values.mean()), spread))
        else:
            found.append(ScopedValue(parameter, "nominal", parameter.nominal, 0.0))
    return found


def _identified(tree: xr.DataTree, name: str) -> dict[str, tuple[float, float]]:
    """Identified values of a scoped parameter with their standard deviations, by what they belong to (best mode).

    They stand in the group ``scoped`` of a mode; a result without it knows none.
    """
    node = tree["modes/m1"].children.get("scoped")
    if node is None or name not in node.dataset["parameter_scoped"].values:
        return {}
    own = node.dataset.sel(parameter_scoped=name)
    cells = zip(*(own[key].values for key in ("label", "value", "sd")), strict=True)
    return {str(label): (float(value), float(sd)) for label, value, sd in cells}
