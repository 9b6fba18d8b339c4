"""What the command ``mofit design`` does: read the file, compute, return a result that is ready to be reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

from mofit.data import Campaign, Experiment
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.experimental_design.candidate_space import Space, default_space, read_space
from mofit.experimental_design.candidates import candidates, declared_limits, driven_input
from mofit.experimental_design.criteria import Criterion, Discrimination, discrimination, parameter_criterion
from mofit.experimental_design.optimal_design import Design, DesignEvaluation, optimal_design
from mofit.experimental_design.prepare import Inputs, Prepared, prepare, with_simulators
from mofit.experimental_design.simulations_needed import require_simulations
from mofit.experimental_design.sources import Source
from mofit.experimental_design.target import target_of
from mofit.models import Effect, Model, find_effect, laws_of
from mofit.runtime.files import write_text
from mofit.runtime.output_file import PLAN_MARK
from mofit.runtime.progress import Progress, silent
from mofit.simulation.virtual_rig.plan import Plan, TestPlan, plan_text
from mofit.units import Quantity, parse_quantity

#: Values of a condition to choose from: a law with three coefficients is determined best at three.
MOST_VALUES = 3


@dataclass(frozen=True)
class DesignJob:
    """A design as a user asks for it."""

    inputs: Inputs
    """One file, or campaigns that are joined (the tests that there are or will be anyway), and options."""
    space: Path | None = None
    """Space file; without one, tests like those of the file, within what they demonstrate of the rig."""
    parameters: tuple[str, ...] = ()
    """Those to be learnt; by default all that no calibration stage estimates."""
    criterion: str | None = None
    """``c``, ``D``, ``A`` or ``E``; by default c for one parameter or a combination, else D."""
    combination: Mapping[str, float] = field(default_factory=dict)
    """Weights of relative changes, for c."""
    discriminate: tuple[str, ...] = ()
    """Effects to be discriminated (one: from none), instead of parameters to be learnt; names as for ``effects``."""
    budget: Quantity | None = None
    """Time there is; by default that of the longest test of the file."""
    robust: str = "mean"
    """``mean`` or ``worst`` over the parameter samples."""
    ignore_existing: bool = False
    """Whether to start from the calibration stages alone."""
    target: Mapping[str, float] = field(default_factory=dict)
    """Conditions, in SI units, under which the parameters are to be learnt; laws of a run say what they are there."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A finished design: what was asked, the effects discriminated, the space searched, the tests' plan, and notes."""

    job: DesignJob
    effects: tuple[str, ...]
    design: Design
    space: Space
    plan: Plan
    notes: tuple[str, ...]


def design_file(job: DesignJob, progress: Progress = silent) -> Proposal:
    """Read, design, and make a plan of the design.

    Raises
    ------
    InputError
        If files, names and numbers don't fit together.
    """
    if len(job.discriminate) > 2:
        raise InputError.of("--discriminate", f"{len(job.discriminate)} effects", "Name one or two")
    effects = tuple(find_effect(name) for name in job.discriminate)
    if job.target and effects:
        raise InputError.of("--target", "is for parameters, not for effects", "Leave it or --discriminate out")
    progress("read", 0, 0, "")
    written = read_space(job.space) if job.space else None
    with with_simulators(replace(job.inputs, together=True)) as inputs:
        return _designed(replace(job, inputs=inputs), written, effects, progress)


def _designed(job: DesignJob, written: Space | None, effects: Sequence[Effect], progress: Progress) -> Proposal:
    """The steps of a design, in order."""
    (prepared,) = prepare(job.inputs, competing=effects)
    source, base = prepared.source, prepared.plan
    if written is None:
        overhead, _ = parse_quantity("plan, pause", base.pause, "s")
    else:
        overhead, _ = parse_quantity("space, overhead", written.overhead, "s")
    budget, notes = _budget(job.budget, source, overhead)
    named = (*job.parameters, *job.combination)
    target = target_of(source.model, source.space, prepared.samples, job.target, named) if job.target else None
    space = written or _default_space(prepared, budget, overhead, job.target)
    limits = declared_limits(space.limits, source.model)
    plans = space.plans()
    _require_conditions(plans, source.model)
    offered = candidates(base.model_copy(update={"effects": ()}), plans, limits, overhead)
    nuisances = {*source.calibrated, *(parameter.name for effect in effects for parameter in effect.parameters)}
    nuisances |= {*target.coefficients} if target else set()
    every = source.space.names
    names = job.parameters or tuple(job.combination) or tuple(name for name in every if name not in nuisances)
    criterion: Criterion | Discrimination
    if effects:
        criterion = discrimination(source.space, prepared.samples, effects, job.robust)
    else:
        name = job.criterion or ("c" if job.combination or len(job.parameters) == 1 else "D")
        criterion = parameter_criterion(name, every, names, job.combination, job.robust)
        criterion = criterion if target is None else replace(criterion, weights=criterion.weights @ target.rows)
    allowed = sum(not candidate.infeasible for candidate in offered)
    require_simulations(source.model, len(source.tests) + allowed, len(prepared.samples), planned=allowed)
    evaluation = DesignEvaluation(prepared.information(), criterion, job.ignore_existing, prepared.jobs)
    found = optimal_design(evaluation, offered, limits, names, budget, progress, target)
    notes = [*source.notes, *notes, *(target.notes if target else ())]
    return Proposal(job, tuple(effect.name for effect in effects), found, space, _plan(base, found), tuple(notes))


def write_plan(proposal: Proposal, path: Path) -> None:
    """Write the design's tests as a plan for `mofit simulate`."""
    names = ", ".join(file.name for file in proposal.job.inputs.files)
    heading = f"{PLAN_MARK.removeprefix('# ')} {names}."
    write_text(path, plan_text(proposal.plan, heading))


def _budget(given: Quantity | None, source: Source, overhead: float) -> tuple[float, list[str]]:
    if given is None:
        longest = max(test.seconds for test in source.main or source.tests)
        return longest + overhead, [f"No --budget: it is the time of the longest test of the file, {longest:.4g} s."]
    try:
        budget = float(given)
    except ValueError:
        budget, _ = parse_quantity("--budget", given, "s")
    if not budget > 0:
        raise InputError.of("--budget", f"{given} is not above 0", "Give a time, like '120 s'")
    return budget, []


def _default_space(prepared: Prepared, budget: float, overhead: float, target: Mapping[str, float]) -> Space:
    """Tests within what the file's tests demonstrate; a calibration stage's kinds but steps belong to the stage."""
    model, driven = prepared.source.model, driven_input(prepared.source.model)
    known = [test.experiment for test in prepared.source.tests if driven.name in test.experiment.inputs]
    if not known:
        message = f"none of its tests has the input '{driven.name}', so it does not show what the rig can do"
        cure = "Say the tests to choose from with --space; where no input drives the model there are none"
        raise InputError.of(f"FILE {prepared.source.name}", message, cure)
    taken = {kind for stage in model.stages for kind in stage.excitations} - {"step"}
    kinds = {"sine", "multisine", "chirp", "step"} - taken
    conditions = over_conditions(model, [test.experiment for test in prepared.source.tests], target)
    measured = isinstance(prepared.content, Campaign)
    return default_space(known, driven, kinds, budget, overhead, measured=measured, conditions=conditions)


def over_conditions(
    model: Model, experiments: Sequence[Experiment], target: Mapping[str, float] = MappingProxyType({})
) -> dict[str, list[float]]:
    """Of every condition over which parameters follow laws the values of the tests, or least, middle and largest.

    With a target within their range that, too: beyond, the tests do not show that it can be had.
    """
    found = {}
    for name in dict.fromkeys(law.condition for law in laws_of(model)):
        values = sorted({float(one.conditions[name]) for one in experiments if name in one.conditions})
        count = len(values)
        found[name] = values if count <= MOST_VALUES else [values[0], values[count // 2], values[-1]]
        if name in target and values and values[0] < target[name] < values[-1]:
            found[name] = sorted({*found[name], float(target[name])})
    return found


def _require_conditions(plans: Sequence[TestPlan], model: Model) -> None:
    """A condition that the model does not know cannot make a difference."""
    known = [condition.name for condition in model.conditions]
    unknown = {name for plan in plans for name in plan.conditions if name not in known}
    raise_errors(
        Issue(f"space, condition '{name}'", f"model '{model.name}' does not depend on it", did_you_mean(name, known))
        for name in sorted(unknown)
    )


def _plan(base: Plan, found: Design) -> Plan:
    """The design alone, as a plan of the same rig."""
    tests = tuple(
        candidate.plan if number == 0 else candidate.plan.model_copy(update={"name": f"{candidate.name}_{number + 1}"})
        for candidate, times in found.tests
        for number in range(times)
    )
    return base.model_copy(update={"title": f"{base.title}: next tests", "tests": tests})
