"""From files and options to a prepared problem: what a comparison and a design both start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from mofit._typing import FloatArray
from mofit.data import Campaign, read_campaign
from mofit.design.discrimination import with_neutral
from mofit.design.information import SourceInformation, source_information
from mofit.design.parameter_samples import box_samples, posterior_samples, reference_values
from mofit.design.rig_limits import RigLimits, demonstrated_limits, driven_input, required_limits
from mofit.design.sources import Source, measured_source, planned_source
from mofit.errors import Issue, raise_errors
from mofit.models import Effect, Model, default_model, find_effect, find_model, with_effects
from mofit.results import open_result
from mofit.simulation.virtual_rig.plan import NoisePlan, Plan, TestPlan, read_plan


@dataclass(frozen=True)
class Inputs:
    """Files and options.

    Parameters
    ----------
    files
        Campaigns (``.nc``) and plans of `mofit simulate` (``.toml``).
    model, effects
        Names of shipped ones or ``path/to/file.py:Name``; without a model, the plan or the campaign's channels decide.
    at
        Reference values of parameters by name, in SI units.
    run
        Folder of a run, whose posterior gives the parameter samples instead of a box around the reference values.
    samples
        How many parameter samples.
    seed, jobs
        Seed of every random draw; threads.
    """

    files: tuple[Path, ...]
    model: str | None = None
    effects: tuple[str, ...] = ()
    at: Mapping[str, float] = field(default_factory=dict)
    run: Path | None = None
    samples: int = 16
    seed: int = 0
    jobs: int = 1


@dataclass(frozen=True, eq=False)
class Prepared:
    """One file, read and checked.

    Parameters
    ----------
    content
        The plan or campaign.
    model_name, base
        The model without effects, and its name as plans give it.
    source
        The tests with model, reference values and noise.
    samples
        Parameter samples (N, d), the reference values first.
    seed, jobs
        As in `Inputs`.
    """

    content: Plan | Campaign
    model_name: str
    base: Model
    source: Source
    samples: FloatArray
    seed: int
    jobs: int

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Parameters that no calibration stage estimates."""
        return tuple(name for name in self.source.space.names if name not in self.source.calibrated)

    def information(self) -> SourceInformation:
        """Information of the file's tests at the samples; simulates them."""
        return source_information(self.source, self.samples, self.jobs)

    @cached_property
    def limits(self) -> RigLimits:
        """What the tests that excite the driven input demonstrate of the rig."""
        driven, _ = driven_input(self.source.model)
        known = [test.experiment for test in self.source.tests if driven in test.experiment.inputs]
        measured = isinstance(self.content, Campaign)
        return demonstrated_limits([required_limits(experiment, driven, measured) for experiment in known])

    @cached_property
    def plan(self) -> Plan:
        """The plan that more tests join: the file's, or one with the conditions, values and noise of the campaign."""
        if isinstance(self.content, Plan):
            return self.content
        source = self.source
        blank = TestPlan(
            name="none", kind="step", sample_rate=1.0, amplitude=1.0, periods=None, ramp_rate=1.0, duration=1.0
        )
        return Plan(
            title=f"after {source.name}",
            model=self.model_name,
            seed=self.seed,
            parameters={p.name: float(source.values[source.space.index(p.name)]) for p in self.base.parameters},
            conditions={**source.tests[0].experiment.conditions},
            noise={name: NoisePlan(**vars(entry)) for name, entry in source.noise.items()},
            tests=(blank,),
        )


def prepare(inputs: Inputs, named: Sequence[str] = (), competing: Sequence[Effect] = ()) -> tuple[Prepared, ...]:
    """Read every file, choose the model, take the noise and draw the parameter samples.

    Parameters
    ----------
    inputs
        Files and options.
    named
        Tests that belong to the main identification whatever their kind.
    competing
        Effects to be discriminated: they join the model, with the parameters of their size at neutral values.

    Raises
    ------
    InputError
        With what is wrong with files and options.
    """
    stems = [path.stem for path in inputs.files]
    issues = [
        Issue(f"FILE {stem}", "two files have this name", "Rename one of them")
        for stem in sorted({stem for stem in stems if stems.count(stem) > 1})
    ]
    raise_errors(issues if stems else [Issue("FILE", "none is given", "Name a campaign or a plan")])
    prepared = tuple(_prepare(path, inputs, named, competing) for path in inputs.files)
    first = prepared[0].source
    raise_errors(
        Issue(f"FILE {source.name}", f"its model is '{source.model.name}', not '{first.model.name}'", "Name --model")
        for source in (each.source for each in prepared)
        if source.space.names != first.space.names
    )
    return prepared


def _prepare(path: Path, inputs: Inputs, named: Sequence[str], competing: Sequence[Effect]) -> Prepared:
    content: Plan | Campaign = read_plan(path) if path.suffix == ".toml" else read_campaign(path)
    base = _base_model(content, inputs.model)
    model = with_effects(base, *(find_effect(name) for name in inputs.effects), *competing)
    source = (
        planned_source(path.stem, content, model, named, inputs.jobs)
        if isinstance(content, Plan)
        else measured_source(path.stem, content, model, named, inputs.jobs, inputs.seed)
    )
    space = source.space
    values = reference_values(space, with_neutral(space, source.values, competing), inputs.at)
    if inputs.run is not None:
        samples = posterior_samples(open_result(inputs.run), space, values, inputs.samples, inputs.seed)
    else:
        still = {*source.calibrated, *(p.name for e in competing for p in e.parameters if p.neutral is not None)}
        free = tuple(name for name in space.names if name not in still)
        samples = box_samples(space, values, free, inputs.samples, inputs.seed)
    return Prepared(content, inputs.model or base.name, base, source, samples, inputs.seed, inputs.jobs)


def _base_model(content: Plan | Campaign, name: str | None) -> Model:
    """The model named, else that of the plan or of the campaign's channels."""
    if name is not None:
        return find_model(name)
    if isinstance(content, Plan):
        return find_model(content.model)
    return default_model({name for m in content.measurements for name in (*m.experiment.inputs, *m.outputs)})
