"""Ranges of parameters from the data: a mount of 300 N/mm and a seat damper are searched in boxes of their own."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import TypeVar

import numpy as np

from mofit.data import Campaign, Measurement
from mofit.data.signals import smooth_derivatives
from mofit.models import Effect, Model
from mofit.models.initial_state import PREFIX, WRITTEN_FOR
from mofit.models.model import SAMPLE_INTERVAL, TIME, Channel, derivations
from mofit.parameters import Parameter
from mofit.units import power_of_time

Ranged = TypeVar("Ranged", Model, Effect)

#: scale of times for which ranges are written, s: that of ten seconds at 100 Hz
_TYPICAL_TIME = 0.1**0.5
#: range of the first output, whatever its name, for which ranges are written
OUTPUT, _TYPICAL_OUTPUT = "output", 1e3


def data_scales(model: Model, campaign: Campaign) -> dict[str, float]:
    r"""Range of the model's typical channels and conditions in the campaign, and of time, relative to the typical one.

    Ranges are peak to peak, the geometric mean over the tests; a channel that never moves is left out. What a test can
    show lasts from its sampling interval :math:`\Delta t` to its length T: its scale of time is
    :math:`\sqrt{\Delta t \, T}`, the middle on a log scale. Where the initial value of a state is a parameter, the
    scale of the state is among them. The scale of ``output`` is that of the first output.
    """
    first = [channel.name for channel in model.outputs[:1]]
    names = [TIME.name, *model.typical, *first, *(channel.name for channel in _channels(model))]
    scales = {name: scale for name in names if (scale := _mean_range(model, campaign, name)) is not None}
    typical = {TIME.name: _TYPICAL_TIME, **model.typical}
    found = {name: scales[name] / value for name, value in typical.items() if name in scales}
    if any(name in scales for name in first):
        found[OUTPUT] = scales[first[0]] / _TYPICAL_OUTPUT
    return found | _state_scales(model, scales)


def scaled(item: Ranged, scales: Mapping[str, float]) -> Ranged:
    """A model or an effect whose parameters have ranges and nominal values for data of these scales.

    A parameter that grows with something unknown keeps its own.
    """
    parameters = tuple(
        parameter if (factor := _factor(parameter, scales)) is None else parameter.times(factor)
        for parameter in item.parameters
    )
    return item if parameters == tuple(item.parameters) else with_parameters(item, parameters)


def _factor(parameter: Parameter, scales: Mapping[str, float]) -> float | None:
    """By how much the ranges of a parameter grow; None if nothing is known of it."""
    found = [(_known(name, scales), power) for name, power in parameter.scales]
    sizes = [scale**power for scale, power in found if scale is not None]
    return float(np.prod(sizes)) if sizes and len(sizes) == len(found) else None


def _known(name: str, scales: Mapping[str, float]) -> float | None:
    """The scale of the first channel that is known, of ``"one or another"``."""
    return next((scales[one] for one in name.split(" or ") if one in scales), None)


def with_parameters(item: Ranged, parameters: tuple[Parameter, ...]) -> Ranged:
    """A model or an effect with other ranges of its parameters."""
    changed = copy(item)
    changed.parameters = parameters
    return changed


def _channels(model: Model) -> tuple[Channel, ...]:
    """Channels that a state may share its unit with."""
    return (*model.inputs, *model.outputs) if _started(model) else ()


def _started(model: Model) -> list[Channel]:
    """States whose initial value is a parameter."""
    known = {name for parameter in model.parameters for name, _ in parameter.scales}
    return [state for state in model.states if PREFIX + state.name in known]


def _state_scales(model: Model, scales: Mapping[str, float]) -> dict[str, float]:
    """Scale of each state whose initial value is a parameter, relative to that for which its range is written.

    That of a channel in its unit, or in its unit but for a power of time; a plain number is about 1. Without any the
    state is left out.
    """
    sizes = [(c.unit, scales[c.name]) for c in _channels(model) if c.name in scales and c.name != TIME.name]
    found = {}
    for state in _started(model):
        powers = [(power_of_time(state.unit, unit), scale) for unit, scale in [*sizes, ("1", 1.0)]]
        near = [(-abs(k), scale * scales[TIME.name] ** k) for k, scale in powers if k is not None]
        if near:
            found[PREFIX + state.name] = max(near)[1] / WRITTEN_FOR
    return found


def _mean_range(model: Model, campaign: Campaign, name: str) -> float | None:
    """Geometric mean of `_range` over the tests; None where there is none above 0."""
    source, order = derivations(model.inputs).get(name, (name, 0))
    ranges = [_range(measurement, name, source, order) for measurement in campaign.measurements]
    usable = [value for value in ranges if np.isfinite(value) and value > 0]
    if len(set(usable)) == 1:  # exactly
        return usable[0]
    return float(np.exp(np.mean(np.log(usable)))) if usable else None


def _range(measurement: Measurement, name: str, source: str, order: int) -> float:
    """Peak-to-peak range of a channel, of a derivative by smoothing; size of a condition; nan where a test has none."""
    experiment = measurement.experiment
    if name == TIME.name:
        return float(np.sqrt(experiment.step * experiment.length))
    if name == SAMPLE_INTERVAL.name:
        return experiment.step
    if name in experiment.conditions:
        return abs(experiment.conditions[name])
    known = {*experiment.inputs, *measurement.outputs}
    if name in known:
        values = measurement.channel(name)
    elif source in known:
        values = smooth_derivatives(experiment.time, measurement.channel(source), order)[order]
    else:
        return np.nan
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else np.nan
