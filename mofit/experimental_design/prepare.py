"""From files and options to tests, model and parameter samples: what a comparison and a design both start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from mofit._typing import FloatArray
from mofit.data import Campaign, joined, read_campaign
from mofit.errors import InputError, Issue, check_settings, raise_errors
from mofit.experimental_design.criteria import with_neutral
from mofit.experimental_design.information import SourceInformation, source_information
from mofit.experimental_design.parameter_samples import box_samples, posterior_samples, reference_values
from mofit.experimental_design.sources import Source, measured_source, planned_source
from mofit.identification.settings import SIMULATIONS, is_seed
from mofit.models import Effect, Model, default_model, find_effect, find_model, with_effects, with_laws
from mofit.parameters import PER_CAMPAIGN
from mofit.results import open_result
from mofit.results.export import laws_of_run
from mofit.simulation.evaluation.evaluations import evaluations_of, simulator_of, with_evaluations
from mofit.simulation.evaluation.executors import TIMEOUT, evaluated_in
from mofit.simulation.ranges import with_parameters
from mofit.simulation.virtual_rig.plan import NoisePlan, Plan, TestPlan, read_plan

if TYPE_CHECKING:
    import xarray as xr

#: Parameter samples at most: medians over them do not change any more, and every test is simulated at each.
MOST_SAMPLES = 10_000


@dataclass(frozen=True)
class Inputs:
    """Files and options."""

    files: tuple[Path, ...]
    """Campaigns (``.nc``) and plans of `mofit simulate` (``.toml``)."""
    model: str | None = None
    effects: tuple[str, ...] = ()
    """Shipped ones, or ``path/to/file.py:Name``; without a model, the plan or the campaign's channels decide."""
    at: Mapping[str, float] = field(default_factory=dict)
    """Reference values of parameters by name, in SI units."""
    run: Path | None = None
    """Folder of a run, whose posterior gives the parameter samples instead of a box around the reference values. The
    laws of its parameters over conditions become part of the model."""
    samples: int = 16
    """How many parameter samples."""
    seed: int = 0
    jobs: int = 1
    """Seed of every random draw; threads."""
    simulations: int | None = None
    timeout: float | None = None
    dask: str | None = None
    """Of a user's simulator: most simulations (by default `SIMULATIONS`), seconds that one may take, and a cluster that
    they run on."""
    simulators: Mapping[str, Model] = field(default_factory=dict)
    """Users' simulators by name, whose simulations count; see `with_simulators`."""
    together: bool = False
    """Whether several campaigns count as one, each test under the conditions of its own."""

    def __post_init__(self) -> None:
        checks = [
            ("samples", 1 <= self.samples <= MOST_SAMPLES, f"Give 1 to {MOST_SAMPLES}"),
            ("seed", is_seed(self.seed), "Give a whole number, 0 or more"),
            ("jobs", self.jobs >= 1, "Give at least 1"),
            ("simulations", self.simulations is None or self.simulations >= 1, "Give at least 1"),
            ("timeout", self.timeout is None or self.timeout > 0, "Give more than 0 s"),
        ]
        check_settings("design", self, checks)


@contextmanager
def with_simulators(inputs: Inputs) -> Iterator[Inputs]:
    """The inputs; within the block the simulations of users' simulators that they name count, in other processes.

    Raises
    ------
    InputError
        If there is no such model or plan.
    """
    plans = [] if inputs.model else [path for path in inputs.files if path.suffix == ".toml"]
    names = dict.fromkeys([inputs.model] if inputs.model else [read_plan(path).model for path in plans])
    limit = SIMULATIONS if inputs.simulations is None else inputs.simulations
    found = {name: with_evaluations(find_model(name), limit) for name in names}
    found = {name: model for name, model in found.items() if simulator_of(model)}
    with ExitStack() as stack:
        for model in found.values():
            timeout = TIMEOUT if inputs.timeout is None else inputs.timeout
            stack.enter_context(evaluated_in(evaluations_of(model), inputs.jobs, timeout, inputs.dask))
        yield replace(inputs, simulators=found)


@dataclass(frozen=True, eq=False)
class Prepared:
    """One file, read and checked."""

    content: Plan | Campaign
    """The plan or campaign."""
    model_name: str
    base: Model
    """The model without effects, and its name as plans give it."""
    source: Source
    """The tests with model, reference values and noise."""
    samples: FloatArray
    """Parameter samples (N, d), the reference values first."""
    seed: int
    jobs: int
    """As in `Inputs`."""

    def information(self) -> SourceInformation:
        """Information of the file's tests at the samples; simulates them."""
        return source_information(self.source, self.samples, self.jobs)

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

    Tests that are ``named`` belong to the main identification whatever their kind. Effects that are ``competing`` are
    to be discriminated: they join the model, with the parameters of their size at neutral values.

    Raises
    ------
    InputError
        With what is wrong with files and options.
    """
    stems = [path.stem for path in inputs.files]
    if not stems:
        raise InputError.of("FILE", "none is given", "Name a campaign or a plan")
    raise_errors(
        Issue(f"FILE {stem}", "two files have this name", "Rename one of them")
        for stem in sorted({stem for stem in stems if stems.count(stem) > 1})
    )
    contents = _as_one(inputs.files) if inputs.together and len(stems) > 1 else _each(inputs.files)
    run = open_result(inputs.run) if inputs.run is not None else None
    prepared = tuple(_prepared(name, content, run, inputs, named, competing) for name, content in contents.items())
    first = prepared[0].source
    raise_errors(
        Issue(f"FILE {source.name}", f"its model is '{source.model.name}', not '{first.model.name}'", "Name --model")
        for source in (each.source for each in prepared)
        if source.space.names != first.space.names
    )
    return prepared


def _each(files: Sequence[Path]) -> dict[str, Plan | Campaign]:
    return {path.stem: read_plan(path) if path.suffix == ".toml" else read_campaign(path) for path in files}


def _as_one(files: Sequence[Path]) -> dict[str, Plan | Campaign]:
    raise_errors(
        Issue(f"FILE {path.name}", "a plan cannot be joined with other files", "Name one plan, or campaigns")
        for path in files
        if path.suffix == ".toml"
    )
    campaign = joined([read_campaign(path) for path in files], [path.stem for path in files])
    return {f"{files[0].stem} and {len(files) - 1} more": campaign}


def _prepared(
    name: str,
    content: Plan | Campaign,
    run: xr.DataTree | None,
    inputs: Inputs,
    named: Sequence[str],
    competing: Sequence[Effect],
) -> Prepared:
    base = _base_model(content, inputs)
    laws = laws_of_run(run) if run is not None else ()
    extended = with_effects(base, *(find_effect(name) for name in inputs.effects), *competing)
    model, notes = _one_value_each(with_laws(extended, laws))
    if isinstance(content, Plan):
        source = planned_source(name, content, model, named, inputs.jobs)
    else:
        source = measured_source(name, content, model, named, inputs.jobs, inputs.seed)
    source = replace(source, notes=(*source.notes, *(f"{name}: {note}" for note in notes)))
    space = source.space
    values = reference_values(space, with_neutral(space, source.values, competing), inputs.at)
    if run is not None:
        samples = posterior_samples(run, space, values, inputs.samples, inputs.seed)
    else:
        still = {*source.calibrated, *(p.name for e in competing for p in e.parameters if p.neutral is not None)}
        free = tuple(name for name in space.names if name not in still)
        samples = box_samples(space, values, free, inputs.samples, inputs.seed)
    return Prepared(content, inputs.model or base.name, base, source, samples, inputs.seed, inputs.jobs)


def _one_value_each(model: Model) -> tuple[Model, list[str]]:
    """The model with one value of every parameter for all tests, and what to know of it."""
    scoped = [one.name for one in model.parameters if one.per != PER_CAMPAIGN]
    if not scoped:
        return model, []
    parameters = tuple(replace(one, per=PER_CAMPAIGN, pooled=False) for one in model.parameters)
    note = f"{', '.join(scoped)} count as one value for all tests: with one each, the others are a little less certain."
    return with_parameters(model, parameters), [note]


def _base_model(content: Plan | Campaign, inputs: Inputs) -> Model:
    """The model named, else that of the plan or of the campaign's channels."""
    name = inputs.model or (content.model if isinstance(content, Plan) else None)
    if name is not None:
        return inputs.simulators.get(name) or find_model(name)
    assert isinstance(content, Campaign)
    return default_model({name for m in content.measurements for name in (*m.experiment.inputs, *m.outputs)})
