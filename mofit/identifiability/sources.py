"""The tests of a file, run or only planned: how the kernel drives them, and what noise they have or will have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Procedure
from mofit.errors import Fault, did_you_mean, raise_errors
from mofit.identifiability.candidates import candidates
from mofit.identifiability.limits import Reach
from mofit.identifiability.noise import DEFAULT_NOISE, ChannelNoise, NoiseOf, channel_noise, process
from mofit.identifiability.procedures import planned_drives
from mofit.identifiability.statistics import group_of, groups
from mofit.kernel import Drive
from mofit.model import Model
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, build_problem
from mofit.signals import NoiseProcess, noise_process
from mofit.simulate import Plan, read_plan
from mofit.simulate.setup import set_up

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SourceTest:
    """One test of a file.

    Parameters
    ----------
    procedure
        Its signals.
    group
        Place in `mofit.identifiability.statistics.groups`: 0 for the main identification, else a calibration stage.
    drive
        As the kernel sees it; which samples are judged.
    noise
        Per output.
    """

    procedure: Procedure
    group: int
    drive: Drive
    noise: tuple[NoiseOf, ...]

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.procedure.name

    @property
    def seconds(self) -> float:
        """Duration in s."""
        return self.drive.samples * self.drive.step


@dataclass(frozen=True, eq=False)
class Source:
    """A file's tests, ready to be asked what they tell.

    Parameters
    ----------
    name
        Of the file.
    model
        The model that is to be identified.
    space
        Its parameters and their bounds.
    values
        Their values, (d,): the plan's; of a campaign, those of its calibration stages, and nominal.
    tests
        Those of the main identification and of the calibration stages.
    noise
        By output, for tests that are in no file.
    notes
        What a reader should know of how all this came about, in sentences.
    """

    name: str
    model: Model
    space: ParameterSpace
    values: Array
    tests: tuple[SourceTest, ...]
    noise: Mapping[str, ChannelNoise]
    notes: tuple[str, ...] = ()

    @property
    def calibrated(self) -> tuple[str, ...]:
        """Parameters that a calibration stage with tests knows."""
        used = {test.group for test in self.tests}
        return tuple(
            parameter.name
            for number, group in enumerate(groups(self.model))
            if number and number in used
            for parameter in group.model.parameters
            if parameter.name in self.space.names
        )

    @property
    def main(self) -> tuple[SourceTest, ...]:
        """Tests of the main identification."""
        return tuple(test for test in self.tests if test.group == 0)


def read_source(
    path: Path, choose: Callable[[Plan | Campaign], Model], named: Sequence[str] = (), jobs: int = 1, seed: int = 0
) -> Source:
    """Read a plan (``.toml``) or a campaign.

    Parameters
    ----------
    path
        The file.
    choose
        Gives the model for what was read.
    named
        Tests that belong to the main identification whatever their kind; by default all that no stage takes.
    jobs, seed
        Threads, and the seed of the calibration stages' starts.

    Raises
    ------
    InputError
        If the file cannot be read, or does not fit the model.
    """
    if path.suffix == ".toml":
        plan = read_plan(path)
        return planned_source(path.stem, plan, choose(plan), named, jobs)
    from mofit.campaign_file import read_campaign

    campaign = read_campaign(path)
    return measured_source(path.stem, campaign, choose(campaign), named, jobs, seed)


def planned_source(name: str, plan: Plan, model: Model, named: Sequence[str] = (), jobs: int = 1) -> Source:
    """The tests of a plan; effects that the model has not are left out, parameters that it lacks are ignored."""
    bare = plan.model_copy(update={"effects": ()})
    setup = set_up(plan, f"plan '{name}'")
    noise = {channel: ChannelNoise(**settings) for channel, settings in setup.noise.items()}
    space = ParameterSpace(model.parameters)
    values = np.array([setup.values.get(parameter.name, parameter.nominal) for parameter in space.parameters])
    notes = []
    left_out = [effect.name for effect in plan.effects if effect.name not in model.name.split("+")]
    if left_out:
        hidden = ", ".join(left_out)
        notes.append(f"{name}: its effects ({hidden}) are left out; add them to the model with --effect to count them.")
    missing = [channel.name for channel in model.outputs if channel.name not in noise]
    if missing:
        share = f"{100 * DEFAULT_NOISE.fraction:g} % of the range, white"
        notes.append(f"{name}: states no noise of {', '.join(missing)}; taken as {share}.")
    procedures = [candidate.procedure for candidate in candidates(bare, bare.tests, Reach(), 0.0, f"plan '{name}'")]
    _require(name, named, [procedure.name for procedure in procedures])
    tests: list[SourceTest] = []
    for number, group in enumerate(groups(model)):
        own = _of_group(model, number, procedures, named)
        if own:
            point = values[[space.index(parameter.name) for parameter in group.model.parameters]]
            drives = planned_drives(group.model, own, point, jobs, settled=group.settled)
            noises = tuple(noise.get(channel.name, DEFAULT_NOISE) for channel in group.model.outputs)
            tests += [SourceTest(p, number, d, noises) for p, d in zip(own, drives, strict=True)]
    return Source(name, model, space, values, tuple(tests), noise, (*notes, *_uncalibrated(model, tests)))


def measured_source(
    name: str, campaign: Campaign, model: Model, named: Sequence[str] = (), jobs: int = 1, seed: int = 0
) -> Source:
    """The tests of a campaign; their noise is estimated from the data as the identification does."""
    from mofit.calibration import calibrate

    _require(name, named, campaign.tests)
    space = ParameterSpace(model.parameters)
    stages, _ = calibrate(model, campaign, space, seed=seed, jobs=jobs)
    known = {key: value for stage in stages for key, value in stage.values.items()}
    values = np.array([known.get(parameter.name, parameter.nominal) for parameter in space.parameters])
    procedures = [measurement.procedure for measurement in campaign.measurements]
    own = _of_group(model, 0, procedures, named)
    tests: list[SourceTest] = []
    if own:
        problem = build_problem(model, campaign.select([p.name for p in own]), jobs=jobs)
        tests += _measured(problem, 0, own, problem.space.to_unit(values))
    for stage in stages:
        number = [group.stage for group in groups(model)].index(stage.stage)
        tests += _measured(stage.problem, number, [m.procedure for m in stage.problem.measurements], stage.minimum)
    outputs = [channel.name for channel in model.outputs]
    main = [test for test in tests if test.group == 0]
    noise = {
        output: channel_noise([_process_at(test, i) for test in main], [test.drive.step for test in main])
        for i, output in enumerate(outputs)
        if main
    }
    notes = [f"{name}: noise as its data show it."]
    if missing := [p.name for p in space.parameters if p.name not in known]:
        which = ", ".join(missing)
        notes.append(f"{name}: its calibration tests do not tell {which}: from --run or --at, else nominal values.")
    return Source(name, model, space, values, tuple(tests), noise, (*notes, *_uncalibrated(model, tests)))


def _of_group(model: Model, number: int, procedures: Sequence[Procedure], named: Sequence[str]) -> list[Procedure]:
    """Tests of a group: those that its stage takes; of the main identification also those named."""
    return [p for p in procedures if group_of(model, p.kind) == number or (number == 0 and p.name in named)]


def _require(name: str, named: Sequence[str], known: Sequence[str]) -> None:
    raise_errors(
        Fault("--group", f"{name} has no test '{test}'", did_you_mean(test, known))
        for test in named
        if test not in known
    )


def _uncalibrated(model: Model, tests: Sequence[SourceTest]) -> list[str]:
    """Stages without tests, whose parameters only their bounds confine."""
    found = []
    for number, group in enumerate(groups(model)):
        if group.stage is not None and not any(test.group == number for test in tests):
            names = ", ".join(parameter.name for parameter in group.model.parameters)
            kinds = " or ".join(group.stage.procedures)
            found.append(f"No {kinds} test: {names} are free within their bounds.")
    return found


def _measured(problem: Problem, number: int, procedures: Sequence[Procedure], point: Array) -> list[SourceTest]:
    """Tests of a problem with the noise that is left at a point (d,) of its unit cube."""
    near = problem.near(point[None], np.full(len(point), 1e-3))
    found = []
    for t, (procedure, outputs) in enumerate(zip(procedures, near.simulate(point[None]), strict=True)):
        drive, record = problem.drives[t], problem.records[t]
        noises: list[NoiseOf] = []
        for i, channel in enumerate(problem.model.outputs):
            used = drive.weights[:, i] > 0
            simulated = outputs[0, used, i]
            time = np.asarray(drive.step * np.flatnonzero(used))
            if number == 0 and (record.period is None or record.periods < 2):
                # what the model misses at these values is no noise
                noises.append(ChannelNoise(sd=record.noise_sd[channel.name]))
            else:
                noises.append(
                    _Found(noise_process(drive.measured[used, i] - simulated, simulated, time, record.period))
                )
        found.append(SourceTest(procedure, number, drive, tuple(noises)))
    return found


@dataclass(frozen=True)
class _Found:
    """Noise as a record showed it, whatever the parameters."""

    process: NoiseProcess

    def __call__(self, signal: Array, judged: NDArray[np.bool_]) -> tuple[NoiseProcess, ...]:
        return (process(self.process.level, self.process.spectrum),)


def _process_at(test: SourceTest, output: int) -> NoiseProcess:
    judged = test.drive.weights[:, output] > 0
    return test.noise[output](test.drive.measured[:, output], judged)[0]
