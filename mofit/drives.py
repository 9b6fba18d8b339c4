"""A test as the kernel sees it: the model's channels, and which samples are judged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.errors import Fault, InputError, raise_errors
from mofit.kernel import Drive
from mofit.model import Model
from mofit.signals import Record, settled_samples, smooth_derivative

Array = NDArray[np.float64]

#: input that every test has: time since its first sample, s
TIME = "time"
#: conditions that a test has of itself, see `all_conditions`
EVERY_TEST = ("sample_interval", "start_time")
#: share of a period by which a record may fall short of whole ones and still count as such
_SHORT = 0.1


def first_input(model: Model) -> str:
    """The channel that excites the model, from which a test's period is taken."""
    return model.inputs[0].derivative_of or model.inputs[0].name


def require(model: Model, campaign: Campaign) -> None:
    """Refuse a campaign that lacks channels or conditions of the model, naming every one."""
    if not campaign.measurements:
        raise InputError.of(f"campaign '{campaign.title}'", "no test is left to use", "Name tests that it has")
    raise_errors(lacking(model, campaign))


def lacking(model: Model, campaign: Campaign) -> list[Fault]:
    """Every channel and condition of the model that a test of the campaign lacks."""
    faults = []
    for measurement in campaign.measurements:
        have = {**measurement.procedure.inputs, **measurement.outputs}
        conditions = all_conditions(measurement.procedure)
        for channel in (*model.inputs, *model.outputs):
            source = channel.derivative_of or channel.name
            if source not in have and source != TIME:
                faults.append(
                    Fault(
                        f"test '{measurement.name}'",
                        f"model '{model.name}' needs channel '{source}'; the test has {', '.join(sorted(have))}",
                        "Choose another model, or name the channel so in the file or the import map",
                    )
                )
        for condition in model.conditions:
            if condition.default is None and condition.name not in conditions:
                faults.append(
                    Fault(
                        f"test '{measurement.name}'",
                        f"model '{model.name}' needs condition '{condition.name}' in {condition.unit}",
                        "Add it to the campaign's root or to the test's group",
                    )
                )
    return faults


def all_conditions(procedure: Procedure) -> dict[str, float]:
    """Conditions of a test with those that it has of itself: ``sample_interval`` and ``start_time``, in s."""
    start = {} if procedure.start_time is None else {"start_time": procedure.start_time}
    return {"sample_interval": procedure.step, **start, **procedure.conditions}


def to_drive(model: Model, measurement: Measurement, record: Record, settled: bool) -> Drive:
    """A test as the kernel sees it: inputs with their smooth derivatives, and the weight of every sample.

    Weights are 1 / range² of the output where a sample is judged, so that costs are squares of NRMSD; 0 elsewhere.
    """
    procedure = measurement.procedure
    columns: dict[str, Array] = {**procedure.inputs, **measurement.outputs}
    columns[TIME] = procedure.time - procedure.time[0]
    derived = {channel.derivative_of for channel in model.inputs if channel.derivative_of}
    for name in derived:
        # the smoothed signal goes with its derivative, so that both describe one motion
        smooth, slope = smooth_derivative(procedure.time, measurement.channel(name))
        columns[name] = smooth
        columns |= {channel.name: slope for channel in model.inputs if channel.derivative_of == name}
    inputs = np.stack([columns[channel.name] for channel in model.inputs], axis=1)
    measured = np.stack([measurement.channel(channel.name) for channel in model.outputs], axis=1)
    used = settled_samples(procedure.time, _dropped(procedure, record, settled), record.tail)
    spread = np.ptp(measured, axis=0)
    if not np.all(spread > 0):
        raise InputError.of(
            f"test '{measurement.name}'", "the output is constant", "Leave the test out or check the channel"
        )
    given = all_conditions(procedure)
    conditions = [given.get(condition.name, condition.default) for condition in model.conditions]
    return Drive(
        name=measurement.name,
        step=procedure.step,
        inputs=inputs,
        hold=procedure.hold,
        conditions=np.array(conditions, dtype=float),
        measured=np.where(used[:, None], measured, 0.0),
        weights=np.where(used[:, None], 1.0 / spread**2, 0.0),
    )


def _dropped(procedure: Procedure, record: Record, settled: bool) -> float:
    """Time at the start of a test that is not judged, in s."""
    if settled:
        # a step that states no transient is judged in its second half
        return record.transient or 0.5 * float(np.ptp(procedure.time))
    if record.period is None or record.periods <= 1:
        return procedure.transient or 0.0
    # a model started from its own initial state needs a period to settle, too
    dropped = max(record.transient, record.period)
    left = (len(procedure.time) * procedure.step - record.tail - dropped) / record.period
    short = int(left + 0.5 * procedure.step / record.period) + 1 - left
    # not quite a whole one where the record would lose another at its end
    return max(record.transient, dropped - short * record.period) if short < _SHORT else dropped
