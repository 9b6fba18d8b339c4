"""A test in the form that a simulator takes: the model's channels as arrays, and a weight per sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PPoly

from mofit._typing import FloatArray
from mofit.data import Experiment, Measurement
from mofit.data.signals import SignalAnalysis, smooth_derivatives, steady_samples
from mofit.errors import InputError, Issue
from mofit.models import Model, System
from mofit.models.interpolation import input_curve
from mofit.models.model import TIME
from mofit.quantities import HOLD, INTERPOLATIONS
from mofit.simulation.requirements import all_conditions, derived_channels, measured_outputs, undriven

#: lengths of a record for which its inputs are led in, one after the other, until that changes nothing any more: a mode
#: of 1 % damping rings up within eight times twenty of its cycles to 1/e^10
LEADS = (1, 2, 4, 8)
#: samples up to which the curve of the inputs is kept: it takes several times the memory of the samples
_SHORT_TEST = 20_000
#: share of a period within which a time counts as a whole number of periods
_ROUNDING = 1e-9
#: share of a period that a record may lack and still count as whole periods
_SHORT = 0.1


@dataclass(frozen=True, eq=False)
class ExperimentData:
    """Inputs, conditions and measured outputs of a test on a uniform time grid.

    Parameters
    ----------
    name
        Of the test.
    step
        Sampling interval, s.
    inputs
        Shape (lead + n, nu).
    interpolation
        Of the inputs between samples. ``"cubic"``: not-a-knot cubic spline, so that sampling does not limit the
        accuracy of smooth inputs; ``"linear"``: straight lines, for steps; ``"hold"``: the value of the last sample
        (zero-order hold), for what a digital controller puts out.
    conditions
        Shape (nc,).
    measured
        Shape (n, ny); no nan (zero where the weight is zero).
    weights
        Shape (n, ny); zero drops a sample.
    origin
        The test that `changed` made this one from. Both are integrated on the same time grid.
    lead
        Samples of the inputs before the first one of the record: a model that is to begin in its steady state starts
        so much earlier, and its outputs there are not kept.
    """

    name: str
    step: float
    inputs: FloatArray
    interpolation: str
    conditions: FloatArray
    measured: FloatArray
    weights: FloatArray
    origin: ExperimentData | None = None
    lead: int = 0

    def same_data(self, other: ExperimentData) -> bool:
        """Whether two tests are the same to a simulator, so that one can stand for both."""
        if (self.name, self.step, self.interpolation, self.lead) != (
            other.name, other.step, other.interpolation, other.lead,
        ):  # fmt: skip
            return False
        alike = all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("conditions", "inputs"))
        return alike and self.same_record(other)

    def same_record(self, other: ExperimentData) -> bool:
        """Whether two tests have the same measured outputs and weights."""
        if self.name != other.name or self.origin is not None or other.origin is not None:
            return False
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("measured", "weights"))

    def changed(self, **data: FloatArray) -> ExperimentData:
        """With other measured outputs or weights, or with fewer samples."""
        return replace(self, origin=self.origin or self, **data)  # type: ignore[arg-type]

    def first(self, count: int) -> ExperimentData:
        """The first samples of its record; the same object when asked for again."""
        if count >= self.recorded:
            return self
        known: dict[int, ExperimentData] = vars(self).setdefault("_first", {})
        if count not in known:
            inputs = self.inputs[: self.lead + count]
            known[count] = self.changed(inputs=inputs, measured=self.measured[:count], weights=self.weights[:count])
        return known[count]

    @property
    def samples(self) -> int:
        """Number of samples that are simulated."""
        return len(self.inputs)

    @property
    def recorded(self) -> int:
        """Number of samples of the record, n."""
        return self.samples - self.lead

    @cached_property
    def fitted(self) -> tuple[int, ...]:
        """Outputs with a weight at some sample, by index; the only output of a model counts in any case."""
        several = self.weights.shape[1] > 1
        return tuple(np.flatnonzero(np.any(self.weights != 0, axis=0)).tolist()) if several else (0,)

    def packed(self) -> FloatArray:
        """What loops read, per sample: 1 if any output has a weight, the measured outputs, the weights.

        Shape (lead + n, 1 + 2 ny). That of a short test is kept.
        """
        known: FloatArray | None = vars(self).get("_packed")
        if known is not None:
            return known
        ny = self.measured.shape[1]
        data = np.zeros((self.samples, 1 + 2 * ny))
        record = data[self.lead :]
        record[:, 0] = np.any(self.weights != 0, axis=1)
        record[:, 1 : 1 + ny], record[:, 1 + ny :] = self.measured, self.weights
        if self.samples <= _SHORT_TEST:
            vars(self)["_packed"] = data
        return data

    @cached_property
    def curve(self) -> PPoly:
        """The inputs over time."""
        return input_curve(self.step, self.inputs, self.interpolation)

    @cached_property
    def rate(self) -> PPoly:
        """Time derivative of the inputs over time."""
        return self.curve.derivative()

    def forget_curves(self) -> None:
        """Called when they have been used: they take several times the memory of the samples.

        That of a short test is kept.
        """
        vars(self).pop("rate", None)
        if self.samples > _SHORT_TEST:
            vars(self).pop("curve", None)

    def at(self, time: FloatArray) -> FloatArray:
        """Inputs at times, shape (nu, len(time)); constant after the last sample."""
        return np.asarray(self.curve(np.minimum(time, (self.samples - 1) * self.step)).T)

    def during(self, start: FloatArray, time: FloatArray) -> FloatArray:
        """Inputs at times (n,) of steps that begin at ``start`` (n,): one that is held does not change within them."""
        return self.at(start if self.interpolation == HOLD else time)

    def derivative(self, time: FloatArray) -> FloatArray:
        """Time derivative of the inputs (from the right at samples), shape (nu, len(time))."""
        return np.asarray(self.rate(np.minimum(time, (self.samples - 1) * self.step)).T)

    def issues(self, system: System) -> list[Issue]:
        """Every mismatch with the system."""
        n, ny = self.recorded, len(system.outputs)
        where = f"test '{self.name}'"
        found = [
            Issue(where, f"{what} have shape {np.shape(value)}, not {shape}", "Give one column per channel")
            for what, value, shape in (
                ("inputs", self.inputs, (self.samples, len(system.inputs))),
                ("measured outputs", self.measured, (n, ny)),
                ("weights", self.weights, (n, ny)),
                ("conditions", self.conditions, (len(system.conditions),)),
            )
            if np.shape(value) != shape
        ]
        if n == 0 or not self.step > 0:
            found.append(Issue(where, f"{n} samples every {self.step} s", "Give samples on a uniform time grid"))
        if self.interpolation not in INTERPOLATIONS:
            hint = f"Use {', '.join(map(repr, INTERPOLATIONS))}"
            found.append(Issue(where, f"interpolation is '{self.interpolation}'", hint))
        for what, value in (("inputs", self.inputs), ("measured outputs", self.measured), ("weights", self.weights)):
            if not np.all(np.isfinite(value)):
                found.append(Issue(where, f"{what} hold nan or infinite values", "Set weight and value to 0 there"))
        return found


def objective_pairs(experiments: Sequence[ExperimentData]) -> tuple[tuple[int, int], ...]:
    """What is fitted, test by test: index of a test, and of an output that was measured in it."""
    return tuple((test, output) for test, experiment in enumerate(experiments) for output in experiment.fitted)


def objectives_of(experiments: Sequence[ExperimentData], tests: Sequence[int]) -> list[int]:
    """The objectives of some tests, by index, in the order of these tests."""
    pairs = objective_pairs(experiments)
    return [k for wanted in tests for k, (test, _) in enumerate(pairs) if test == wanted]


def experiment_data(model: Model, measurement: Measurement, record: SignalAnalysis, settled: bool) -> ExperimentData:
    """A measured test: inputs with their smooth derivatives, and a weight per sample.

    The weight is 1 / range² of the output where a sample is used in the fit, so that costs are squares of NRMSD; 0
    elsewhere, and for an output that the test lacks.

    Parameters
    ----------
    model
        Gives channels and conditions in their order.
    measurement
        The test, with all that the model needs (`require`).
    record
        Its period and transient.
    settled
        Use only the steady state after the transient.

    Raises
    ------
    InputError
        If an output is constant.
    """
    experiment = measurement.experiment
    columns: dict[str, FloatArray] = {**experiment.inputs, **measurement.outputs}
    derived = derived_channels(model)
    if undriven(model, experiment):
        columns |= {channel.name: np.zeros(len(experiment.time)) for channel in model.inputs}
        derived = {}
    for name, orders in derived.items():
        # the smoothed signal goes with its derivatives, so that all describe one motion
        smooth = smooth_derivatives(experiment.time, measurement.channel(name), max(orders.values()))
        columns |= {name: smooth[0], **{derivative: smooth[order] for derivative, order in orders.items()}}
    used = steady_samples(experiment.time, _dropped(experiment, record, settled), record.tail)
    measured = np.zeros((len(used), len(model.outputs)))
    weights = np.zeros_like(measured)
    have = measured_outputs(model, measurement)
    for index, channel in enumerate(model.outputs):
        if channel.name not in have:
            continue
        values = measurement.channel(channel.name)
        if not (span := np.ptp(values)) > 0:
            raise InputError.of(
                f"test '{measurement.name}'",
                "the output is constant" if len(have) == 1 else f"the output '{channel.name}' is constant",
                "Leave the test out or check the channel",
            )
        measured[used, index], weights[used, index] = values[used], 1 / np.square(span)
    return _led(in_model_order(model, experiment, columns, measured, weights), model, record)


def _led(data: ExperimentData, model: Model, record: SignalAnalysis) -> ExperimentData:
    """The test with its inputs repeated before the first sample, for the time that the analysis says."""
    lead, period = round(record.lead / data.step), record.input_period
    if not lead or period is None:
        return data
    before = -data.step * np.arange(lead, 0, -1)
    repeated = data.at(before + np.ceil(-before / period - _ROUNDING) * period).T
    repeated[:, [channel.name == TIME.name for channel in model.inputs]] = 0.0
    return replace(data, inputs=np.concatenate([repeated, data.inputs]), lead=lead)


def in_model_order(
    model: Model,
    experiment: Experiment,
    columns: Mapping[str, FloatArray],
    measured: FloatArray,
    weights: FloatArray,
) -> ExperimentData:
    """A test from its input ``columns`` by name, and from measured outputs and weights, each (n, ny)."""
    columns = {**columns, TIME.name: experiment.time - experiment.time[0]}
    given = all_conditions(experiment)
    return ExperimentData(
        name=experiment.name,
        step=experiment.step,
        inputs=np.stack([columns[channel.name] for channel in model.inputs], axis=1),
        interpolation=experiment.interpolation,
        conditions=np.array([given.get(c.name, c.default) for c in model.conditions], dtype=float),
        measured=measured,
        weights=weights,
    )


def _dropped(experiment: Experiment, record: SignalAnalysis, settled: bool) -> float:
    """Time at the start of a test that the fit leaves out, s."""
    if settled:
        # without a known transient: the second half is used
        return record.transient or 0.5 * float(np.ptp(experiment.time))
    if record.period is None or record.periods <= 1:
        return experiment.transient or 0.0
    # the model starts from its own initial state and needs a period to reach its steady state
    dropped = max(record.transient, record.period)
    left = (len(experiment.time) * experiment.step - record.tail - dropped) / record.period
    short = int(left + 0.5 * experiment.step / record.period) + 1 - left
    # a little less than a period where the record would otherwise lose a whole one at its end
    return max(record.transient, dropped - short * record.period) if short < _SHORT else dropped
