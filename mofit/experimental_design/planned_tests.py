"""Tests as the estimate uses them, run or only planned: their stage, the samples of the fit, their noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.data.signals import SignalAnalysis, find_transient, steady_samples
from mofit.errors import InputError
from mofit.experimental_design.noise_model import DEFAULT_NOISE, ChannelNoise, NoiseModel
from mofit.identification.calibration import stage_model
from mofit.models import Model, Stage, build_system
from mofit.simulation import ExperimentData, Simulator, experiment_data, require

#: Error of the simulation that only finds transients, relative to the output's range.
_TOLERANCE = 1e-4


@dataclass(frozen=True)
class Group:
    """Tests that are fitted together: those of the main identification (no ``stage``), or of a calibration stage."""

    model: Model
    stage: Stage | None = None

    @property
    def settled(self) -> bool:
        """Whether only the samples after the transient of a test are used."""
        return self.stage is not None and self.stage.settled


def groups(model: Model) -> tuple[Group, ...]:
    """The main identification and the calibration stages of a model, whose parameters follow its laws."""
    return (Group(model), *(Group(stage_model(stage, model), stage) for stage in model.stages))


def group_of(model: Model, kind: str) -> int:
    """Place in `groups` of the tests of a kind: the stage that takes them, else the main identification."""
    return next((number for number, stage in enumerate(model.stages, start=1) if kind in stage.excitations), 0)


@dataclass(frozen=True, eq=False)
class DesignTest:
    """One test of a design."""

    experiment: Experiment
    """Its definition and signals."""
    group: int
    """Place in `groups`: 0 for the main identification, else a calibration stage."""
    data: ExperimentData
    """As the simulator sees it; samples with weight are used in the fit."""
    noise: tuple[NoiseModel, ...]
    """Per output."""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.experiment.name

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return self.data.samples * self.data.step


def in_group(model: Model, number: int, experiments: Sequence[Experiment], named: Sequence[str]) -> list[Experiment]:
    """Tests of a group: those that its stage takes, in the main identification also those named."""
    return [e for e in experiments if group_of(model, e.kind) == number or (number == 0 and e.name in named)]


def planned_tests(
    model: Model,
    experiments: Sequence[Experiment],
    values: FloatArray,
    noise: Mapping[str, ChannelNoise],
    named: Sequence[str] = (),
    jobs: int = 1,
) -> list[DesignTest]:
    """Tests that need not have been run, group by group.

    Tests of the main identification are those of no stage, and those ``named``. The values (d,) of all parameters
    decide how long transients last. Noise is by output: `DEFAULT_NOISE` where an output is not named.

    Raises
    ------
    InputError
        With every channel and condition that a test lacks; if the model gives no finite output.
    """
    names = [parameter.name for parameter in model.parameters]
    tests: list[DesignTest] = []
    for number, group in enumerate(groups(model)):
        own = in_group(model, number, experiments, named)
        if own:
            point = values[[names.index(parameter.name) for parameter in group.model.parameters]]
            data = planned_data(group.model, own, point, jobs, settled=group.settled)
            noises = tuple(noise.get(channel.name, DEFAULT_NOISE) for channel in group.model.outputs)
            tests += [DesignTest(e, number, d, noises) for e, d in zip(own, data, strict=True)]
    return tests


def planned_data(
    model: Model, experiments: Sequence[Experiment], values: FloatArray, jobs: int = 1, *, settled: bool = False
) -> tuple[ExperimentData, ...]:
    """Tests as the simulator sees them, their outputs simulated at ``values`` (p,) without noise.

    Transients are left out as the identification does: at least one period of a periodic test, and more where the
    simulated output takes longer to settle; with ``settled``, the first half of a test that does not repeat.
    """
    units = {channel.name: channel.unit for channel in (*model.inputs, *model.outputs)}
    # any signal that is not constant serves until the true one is simulated
    blank = [
        Measurement(e, {c.name: np.linspace(0.0, 1.0, len(e.time)) for c in model.outputs}, units) for e in experiments
    ]
    require(model, Campaign("planned", "simulated", {}, tuple(blank)))
    open_data = [experiment_data(model, m, _analysis(m, None), settled) for m in blank]
    simulator = Simulator(build_system(model), open_data, (), jobs=jobs, tolerance=_TOLERANCE)
    found = []
    for measurement, outputs in zip(blank, simulator.simulate(values[None]), strict=True):
        if not np.all(np.isfinite(outputs)):
            raise InputError.of(
                f"test '{measurement.name}'", f"model '{model.name}' gives no finite output",
                "Check the parameters' values and the test's amplitude",
            )  # fmt: skip
        channels = {channel.name: outputs[0][:, i] for i, channel in enumerate(model.outputs)}
        simulated = replace(measurement, outputs=channels)
        found.append(experiment_data(model, simulated, _analysis(simulated, measurement.experiment.frequency), settled))
    return tuple(found)


def _analysis(measurement: Measurement, frequency: float | None) -> SignalAnalysis:
    """What is known of a test without noise: its period from its frequency, its transient from its output."""
    time, experiment = measurement.time, measurement.experiment
    if not frequency or measurement.kind == "step":
        return SignalAnalysis(None, 0, 0.0, 0.0, {}, "none", {})
    period = 1 / frequency
    ends = [find_transient(time, values, period) for values in measurement.outputs.values()]
    transient, tail = max(first for first, _ in ends), max(last for _, last in ends)
    if experiment.transient is not None:
        transient = experiment.transient
    kept = steady_samples(time, transient, tail)
    periods = int((np.count_nonzero(kept) + 0.5) * experiment.step / period)
    return SignalAnalysis(period, periods, transient, tail, {}, "none", {})
