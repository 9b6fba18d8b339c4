"""The tests of a file, measured or only planned, with the model, its reference values and the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment
from mofit.data.signals import NoiseProcess, noise_process, repeats
from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.experimental_design.noise_model import DEFAULT_NOISE, ChannelNoise, MeasuredNoise, NoiseModel, channel_noise
from mofit.experimental_design.planned_tests import DesignTest, groups, in_group, planned_tests
from mofit.identification.calibration import calibrate
from mofit.models import Model
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, build_problem, model_failures
from mofit.simulation.ranges import data_scales, scaled
from mofit.simulation.virtual_rig.plan import Plan
from mofit.simulation.virtual_rig.rig import run_plan
from mofit.simulation.virtual_rig.setup import set_up

#: Width, in the unit cube, of the neighbourhood in which a campaign is simulated for its residuals.
_NEAR = 1e-3


@dataclass(frozen=True, eq=False)
class Source:
    """A file's tests."""

    name: str
    """Of the file."""
    model: Model
    """The model to be identified."""
    space: ParameterSpace
    """Its parameters and their bounds."""
    values: FloatArray
    """Their reference values, (d,): the plan's; of a campaign those of its calibration stages, else nominal."""
    tests: tuple[DesignTest, ...]
    """Those of the main identification and of the calibration stages."""
    noise: Mapping[str, ChannelNoise]
    """By output, for tests that are in no file."""
    notes: tuple[str, ...] = ()
    """What a reader should know about these assumptions, in sentences."""

    @property
    def calibrated(self) -> tuple[str, ...]:
        """Parameters that a calibration stage with tests estimates."""
        used = {test.group for test in self.tests}
        return tuple(
            parameter.name
            for number, group in enumerate(groups(self.model))
            if number and number in used
            for parameter in group.model.parameters
            if parameter.name in self.space.names
        )

    @property
    def main(self) -> tuple[DesignTest, ...]:
        """Tests of the main identification."""
        return tuple(test for test in self.tests if test.group == 0)


def planned_source(name: str, plan: Plan, model: Model, named: Sequence[str] = (), jobs: int = 1) -> Source:
    """The tests of a plan; its effects count only where the model has them.

    Tests that are ``named`` belong to the main identification whatever their kind.

    Raises
    ------
    InputError
        If the plan does not fit the model.
    """
    setup = set_up(plan, f"plan '{name}'")
    noise = {channel: ChannelNoise(**settings) for channel, settings in setup.noise.items()}
    if any(parameter.scales for parameter in model.parameters):
        model = scaled(model, data_scales(model, run_plan(plan)))
    space = ParameterSpace(model.parameters)
    values = np.array([setup.values.get(parameter.name, parameter.nominal) for parameter in space.parameters])
    notes = []
    if hidden := ", ".join(effect.name for effect in plan.effects if effect.name not in model.name.split("+")):
        notes.append(f"{name}: its effects ({hidden}) are left out. To count them, add them with --effect.")
    if missing := ", ".join(channel.name for channel in model.outputs if channel.name not in noise):
        share = f"{100 * DEFAULT_NOISE.fraction:g} % of the range, white"
        notes.append(f"{name}: it states no noise of {missing}. The noise is taken as {share}.")
    experiments = [test.experiment(np.random.default_rng(plan.seed), setup.conditions) for test in setup.tests]
    _require(name, named, [experiment.name for experiment in experiments])
    tests = planned_tests(model, experiments, values, noise, named, jobs)
    return Source(name, model, space, values, tuple(tests), noise, (*notes, *_uncalibrated(model, tests)))


def measured_source(
    name: str, campaign: Campaign, model: Model, named: Sequence[str] = (), jobs: int = 1, seed: int = 0
) -> Source:
    """The tests of a campaign; their noise is estimated from the data as the identification does.

    The seed is that of the starts of the calibration stages.
    """
    _require(name, named, campaign.tests)
    model = scaled(model, data_scales(model, campaign))
    space = ParameterSpace(model.parameters)
    stages, _ = calibrate(model, campaign, space, seed=seed, jobs=jobs)
    known = {key: value for stage in stages for key, value in stage.values.items()}
    values = np.array([known.get(parameter.name, parameter.nominal) for parameter in space.parameters])
    own = in_group(model, 0, [measurement.experiment for measurement in campaign.measurements], named)
    main: list[DesignTest] = []
    if own:
        problem = build_problem(model, campaign.select([e.name for e in own]), jobs=jobs)
        raise_errors(model_failures(problem, values))
        main = _measured(problem, 0, own, problem.space.to_unit(values))
    tests = [*main]
    for stage in stages:
        number = [group.stage for group in groups(model)].index(stage.stage)
        tests += _measured(stage.problem, number, [m.experiment for m in stage.problem.measurements], stage.minimum)
    noise = {
        channel.name: channel_noise([_process(test, i) for test in have], [test.data.step for test in have])
        for i, channel in enumerate(model.outputs)
        if (have := [test for test in main if i in test.data.fitted])
    }
    notes = [f"{name}: noise as estimated from its data."]
    if missing := ", ".join(parameter.name for parameter in space.parameters if parameter.name not in known):
        notes.append(
            f"{name}: its calibration tests do not identify {missing}. "
            "Their values are those of --run or --at, or nominal."
        )
    return Source(name, model, space, values, tuple(tests), noise, (*notes, *_uncalibrated(model, tests)))


def _require(name: str, named: Sequence[str], known: Sequence[str]) -> None:
    raise_errors(
        Issue("--group", f"{name} has no test '{test}'", did_you_mean(test, known))
        for test in named
        if test not in known
    )


def _uncalibrated(model: Model, tests: Sequence[DesignTest]) -> list[str]:
    """Stages without tests, whose parameters only their bounds confine."""
    found = []
    for number, group in enumerate(groups(model)):
        if group.stage is not None and not any(test.group == number for test in tests):
            names = ", ".join(parameter.name for parameter in group.model.parameters)
            kinds = " or ".join(group.stage.excitations)
            found.append(f"No {kinds} test: {names} are free within their bounds.")
    return found


def _measured(problem: Problem, number: int, experiments: Sequence[Experiment], point: FloatArray) -> list[DesignTest]:
    """Tests of a problem with the residual noise at a point (d,) of its unit cube."""
    near = problem.near(point[None], np.full(len(point), _NEAR))
    found = []
    for t, (experiment, outputs) in enumerate(zip(experiments, near.simulate(point[None]), strict=True)):
        data, record = problem.experiments[t], problem.signals[t]
        noises: list[NoiseModel] = []
        for i, channel in enumerate(problem.model.outputs):
            used = data.weights[:, i] > 0
            if i not in data.fitted:  # not measured: no noise is asked for
                noises.append(ChannelNoise(sd=0.0))
                continue
            simulated = outputs[0, used, i]
            time = np.asarray(data.step * np.flatnonzero(used))
            if number == 0 and (record.period is None or not repeats(len(time) * data.step / record.period)):
                # the residual of samples that do not repeat holds the model discrepancy as well
                noises.append(ChannelNoise(sd=record.noise_sd[channel.name]))
            else:
                residual = data.measured[used, i] - simulated
                noises.append(MeasuredNoise(noise_process(residual, simulated, time, record.period)))
        found.append(DesignTest(experiment, number, data, tuple(noises)))
    return found


def _process(test: DesignTest, output: int) -> NoiseProcess:
    used = test.data.weights[:, output] > 0
    return test.noise[output](test.data.measured[:, output], used)[0]
