"""Ranges of parameters from the data: a mount of 300 N/mm and a seat damper are searched in boxes of their own."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import TypeVar

import numpy as np

from mofit.data import Campaign, Measurement
from mofit.data.signals import smooth_derivative
from mofit.models import Effect, Model
from mofit.models.model import SAMPLE_INTERVAL, TIME
from mofit.parameters import Parameter

Ranged = TypeVar("Ranged", Model, Effect)

#: scale of times for which ranges are written, s: that of ten seconds at 100 Hz
_TYPICAL_TIME = 0.1**0.5


def data_scales(model: Model, campaign: Campaign) -> dict[str, float]:
    r"""Range of each of the model's typical channels in the campaign, and of time, relative to the typical one.

    Ranges are peak to peak, the geometric mean over the tests; a channel that never moves is left out. What a test can
    show lasts from its sampling interval :math:`\Delta t` to its length T: its scale of time is
    :math:`\sqrt{\Delta t \, T}`, the middle on a log scale.
    """
    derived = {channel.name: channel.derivative_of for channel in model.inputs}
    found = {}
    for name, typical in {TIME.name: _TYPICAL_TIME, **model.typical}.items():
        ranges = [_range(measurement, name, derived.get(name)) for measurement in campaign.measurements]
        usable = [value for value in ranges if np.isfinite(value) and value > 0]
        if usable:
            found[name] = float(np.exp(np.mean(np.log(usable)))) / typical
    return found


def scaled(item: Ranged, scales: Mapping[str, float]) -> Ranged:
    """A model or an effect whose parameters have ranges and nominal values for data of these scales.

    A parameter that grows with something unknown keeps its own.
    """
    parameters = tuple(
        parameter.times(float(np.prod([scales[name] ** power for name, power in parameter.scales])))
        if parameter.scales and all(name in scales for name, _ in parameter.scales)
        else parameter
        for parameter in item.parameters
    )
    return item if parameters == tuple(item.parameters) else with_parameters(item, parameters)


def with_parameters(item: Ranged, parameters: tuple[Parameter, ...]) -> Ranged:
    """A model or an effect with other ranges of its parameters."""
    changed = copy(item)
    changed.parameters = parameters
    return changed


def _range(measurement: Measurement, name: str, derivative_of: str | None) -> float:
    """Peak-to-peak range of a channel, nan where the test has none; of a derivative, by smoothing; scale of time."""
    experiment = measurement.experiment
    if name == TIME.name:
        return float(np.sqrt(experiment.step * experiment.length))
    if name == SAMPLE_INTERVAL.name:
        return experiment.step
    known = {*experiment.inputs, *measurement.outputs}
    if name in known:
        values = measurement.channel(name)
    elif derivative_of in known and derivative_of is not None:
        _, values = smooth_derivative(experiment.time, measurement.channel(derivative_of))
    else:
        return np.nan
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else np.nan
