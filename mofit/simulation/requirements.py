"""What a model needs of a test: channels and conditions."""

from __future__ import annotations

from mofit.data import Campaign, Experiment, Measurement
from mofit.data.signals import SignalAnalysis, analyse
from mofit.errors import InputError, Issue, raise_errors
from mofit.models import Model
from mofit.models.model import RECORD_LENGTH, SAMPLE_INTERVAL, TIME, derivations

#: conditions that follow from a test's time axis, see `all_conditions`
TIME_CONDITIONS = (SAMPLE_INTERVAL.name, RECORD_LENGTH.name, "start_time")
#: condition that a sine states as its own
FREQUENCY = "frequency"


def measured_outputs(model: Model, measurement: Measurement) -> list[str]:
    """Names of the model's outputs that a test has, in the model's order."""
    have = {*measurement.experiment.inputs, *measurement.outputs}
    return [channel.name for channel in model.outputs if channel.name in have]


def undriven(model: Model, experiment: Experiment) -> bool:
    """Whether a test is a free decay: no input drives the model's states, so that its inputs are zero."""
    channels = {source for source, _ in derivations(model.inputs).values()} - {TIME.name}
    return model.dynamic and not (channels and experiment.inputs)


def first_input(model: Model) -> str:
    """Name of the channel that excites the model; it gives a test's period."""
    return derivations(model.inputs)[model.inputs[0].name][0]


def analysed(model: Model, measurement: Measurement) -> SignalAnalysis:
    """Period, transient and noise of a test that has an output of the model; all inputs that the model reads repeat."""
    output, experiment = measured_outputs(model, measurement)[0], measurement.experiment
    if undriven(model, experiment):
        return analyse(measurement, None, output)
    first, sources = first_input(model), dict.fromkeys(source for source, _ in derivations(model.inputs).values())
    beside = tuple(name for name in sources if name != first and name in experiment.inputs)
    return analyse(measurement, first, output, beside)


def exciting_channel(model: Model, measurement: Measurement) -> str:
    """Name of the channel that excites a test: the model's first input, or the response itself of a free decay."""
    if undriven(model, measurement.experiment):
        return measured_outputs(model, measurement)[0]
    return first_input(model)


def derived_channels(model: Model) -> dict[str, dict[str, int]]:
    """Of every channel that is differentiated, the model's inputs that follow from it, with the order of each."""
    found: dict[str, dict[str, int]] = {}
    for name, (source, order) in derivations(model.inputs).items():
        if order:
            found.setdefault(source, {})[name] = order
    return found


def require(model: Model, campaign: Campaign) -> None:
    """Raise an `InputError` that names every channel and condition of the model that the campaign lacks.

    Of several outputs a test may lack some, but not all.
    """
    if not campaign.measurements:
        raise InputError.of(f"campaign '{campaign.title}'", "no test is left to use", "Name tests that it has")
    raise_errors(lacking(model, campaign))


def lacking(model: Model, campaign: Campaign, *, outputs_too: bool = True) -> list[Issue]:
    """Every channel and condition of the model that a test of the campaign lacks; some of several outputs may.

    A prediction needs no output at all: ``outputs_too`` is False.
    """
    issues = []
    inputs = list(dict.fromkeys(source for source, _ in derivations(model.inputs).values()))
    outputs = [f"'{channel.name}'" for channel in model.outputs]
    any_output = f"channel {outputs[0]}" if len(outputs) == 1 else f"at least one of the channels {', '.join(outputs)}"
    for measurement in campaign.measurements:
        where, needs = f"test '{measurement.name}'", f"model '{model.name}' needs"
        have = {**measurement.experiment.inputs, **measurement.outputs}
        conditions = all_conditions(measurement.experiment)
        driven = not undriven(model, measurement.experiment)
        missing = [f"channel '{source}'" for source in inputs if driven and source not in have and source != TIME.name]
        missing += [any_output] if outputs_too and not measured_outputs(model, measurement) else []
        issues += [
            Issue(
                where,
                f"{needs} {what}; the test has {', '.join(sorted(have))}",
                "Choose another model, or name the channel so in the file or the import map",
            )
            for what in missing
        ]
        issues += [
            Issue(
                where,
                f"{needs} condition '{condition.name}' in {condition.unit}",
                "Add it to the campaign's root or to the test's group",
            )
            for condition in model.conditions
            if condition.default is None and condition.name not in conditions
        ]
    return issues


def stated_conditions(campaign: Campaign) -> set[str]:
    """Conditions that every test of the campaign states."""
    return set.intersection(*({*m.experiment.conditions} for m in campaign.measurements))


def all_conditions(experiment: Experiment) -> dict[str, float]:
    """Conditions of a test, with its sampling interval, its length and its start since the campaign began, all in s.

    Of a sine that states it, its frequency [Hz], too.
    """
    start = {} if experiment.start_time is None else {"start_time": experiment.start_time}
    start |= {} if experiment.frequency is None else {FREQUENCY: experiment.frequency}
    axis = {SAMPLE_INTERVAL.name: experiment.step, RECORD_LENGTH.name: experiment.length}
    return {**axis, **start, **experiment.conditions}
