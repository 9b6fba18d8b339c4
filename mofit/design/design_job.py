"""What the command ``mofit design`` does: read the file, compute, return a result that is ready to be reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mofit.design.candidate_space import Space, read_space
from mofit.design.candidates import candidates
from mofit.design.criteria import parameter_criterion
from mofit.design.default_space import default_space
from mofit.design.discrimination import discrimination
from mofit.design.optimal_design import Design, DesignEvaluation, optimal_design
from mofit.design.prepare import Inputs, Prepared, prepare
from mofit.design.rig_limits import declared_limits, driven_input
from mofit.design.sources import Source
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import Model, find_effect
from mofit.runtime.progress import Progress, silent
from mofit.simulation.virtual_rig.plan import Plan, TestPlan
from mofit.units import Quantity, parse_quantity


@dataclass(frozen=True)
class DesignJob:
    """A design as a user asks for it.

    Parameters
    ----------
    inputs
        One file (the tests that there are or will be anyway) and options.
    space
        Space file; without one, tests like those of the file, within what they demonstrate of the rig.
    parameters
        Those to be learnt; by default all that no calibration stage estimates.
    criterion
        ``c``, ``D``, ``A`` or ``E``; by default c for one parameter or a combination, else D.
    combination
        Weights of relative changes, for c.
    discriminate
        Effects to be discriminated (one: from none), instead of parameters to be learnt; names as for ``effects``.
    budget
        Time there is; by default that of the longest test of the file.
    robust
        ``mean`` or ``worst`` over the parameter samples.
    ignore_existing
        Whether to start from the calibration stages alone.
    """

    inputs: Inputs
    space: Path | None = None
    parameters: tuple[str, ...] = ()
    criterion: str | None = None
    combination: Mapping[str, float] = field(default_factory=dict)
    discriminate: tuple[str, ...] = ()
    budget: Quantity | None = None
    robust: str = "mean"
    ignore_existing: bool = False


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
    progress("read", 0, 0, "")
    (prepared,) = prepare(job.inputs, competing=effects)
    source, base = prepared.source, prepared.plan
    overhead, _ = parse_quantity("plan, pause", base.pause, "s")
    written = read_space(job.space) if job.space else None
    if written is not None:
        overhead, _ = parse_quantity("space, overhead", written.overhead, "s")
    budget, notes = _budget(job.budget, source, overhead)
    space = written or _default_space(prepared, budget, overhead)
    limits = declared_limits(space.limits, source.model)
    plans = space.plans()
    _require_conditions(plans, source.model)
    offered = candidates(base.model_copy(update={"effects": ()}), plans, limits, overhead)
    of_effects = {parameter.name for effect in effects for parameter in effect.parameters}
    names = job.parameters or tuple(job.combination) or tuple(n for n in prepared.free if n not in of_effects)
    criterion = (
        discrimination(source.space, prepared.samples, effects, job.robust)
        if effects
        else parameter_criterion(
            job.criterion or ("c" if job.combination or len(job.parameters) == 1 else "D"),
            source.space.names, names, job.combination, job.robust,
        )
    )  # fmt: skip
    evaluation = DesignEvaluation(prepared.information(), criterion, job.ignore_existing, prepared.jobs)
    found = optimal_design(evaluation, offered, limits, names, budget, progress)
    return Proposal(
        job, tuple(effect.name for effect in effects), found, space, _plan(base, found), (*source.notes, *notes)
    )


def _budget(given: Quantity | None, source: Source, overhead: float) -> tuple[float, list[str]]:
    if given is None:
        longest = max(test.seconds for test in source.main or source.tests)
        return longest + overhead, [
            f"No --budget: the time of the longest test of the file, {longest:.4g} s, is taken."
        ]
    budget, _ = parse_quantity("--budget", float(given) if _is_number(given) else given, "s")
    if not budget > 0:
        raise InputError.of("--budget", f"{given} is not above 0", "Give a time, like '120 s'")
    return budget, []


def _is_number(value: Quantity) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True


def _default_space(prepared: Prepared, budget: float, overhead: float) -> Space:
    """Tests within what the file's tests demonstrate of the rig."""
    model = prepared.source.model
    driven, unit = driven_input(model)
    known = [test.experiment for test in prepared.source.tests if driven in test.experiment.inputs]
    frequencies = [experiment.frequency for experiment in known if experiment.frequency]
    taken = {kind for stage in model.stages for kind in stage.excitations}
    kinds = [kind for kind in ("sine", "multisine", "chirp", "step") if kind not in taken or kind == "step"]
    return default_space(prepared.limits, unit, frequencies, budget, overhead, kinds)


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
