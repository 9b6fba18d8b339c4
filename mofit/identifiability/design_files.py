"""From a file and names to a design: what the command ``mofit design`` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mofit.campaign import Campaign
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.identifiability.candidates import candidates
from mofit.identifiability.criteria import goal
from mofit.identifiability.default_space import default_space
from mofit.identifiability.design import Design, design
from mofit.identifiability.limits import asked, driven_input, reach_of, reach_shown
from mofit.identifiability.points import around, at_values, of_run
from mofit.identifiability.separate import neutral_values, rivalry, strength
from mofit.identifiability.sources import Source, read_source
from mofit.identifiability.space import Space, read_space
from mofit.identifiability.telling import tell
from mofit.model import Effect, Model
from mofit.progress import Progress, silent
from mofit.readers.map_file import Quantity, quantity
from mofit.result import open_result
from mofit.simulate import Plan
from mofit.simulate.plan import NoisePlan, TestPlan


@dataclass(frozen=True)
class DesignJob:
    """A design as a user asks for it.

    Parameters
    ----------
    file
        Campaign, or plan of `mofit simulate`: the tests that there are or will be anyway.
    space
        Space file; without one, tests like those of the file, within what they show that the rig can do.
    parameters
        Those that matter; by default all that no calibration stage knows.
    criterion
        ``c``, ``D``, ``A`` or ``E``; by default c for one parameter or a combination, else D.
    combination
        Weights of relative changes, for c.
    rivals
        Effects to be told apart (one: from nothing), instead of parameters to be learnt.
    budget
        Time there is; by default that of the longest test of the file.
    robust
        ``mean`` or ``worst`` over the parameter points.
    at, run, points
        Values of parameters by name, or a run's folder, and at how many parameter sets all is judged.
    fresh
        Start from nothing but the calibration stages.
    seed, jobs
        Seed of every random draw; threads.
    """

    file: Path
    space: Path | None = None
    parameters: tuple[str, ...] = ()
    criterion: str | None = None
    combination: Mapping[str, float] = field(default_factory=dict)
    rivals: tuple[Effect, ...] = ()
    budget: Quantity | None = None
    robust: str = "mean"
    at: Mapping[str, float] = field(default_factory=dict)
    run: Path | None = None
    points: int = 8
    fresh: bool = False
    seed: int = 0
    jobs: int = 1


@dataclass(frozen=True, eq=False)
class Proposal:
    """A finished design, the space it was looked for in, the plan that it makes, and what a reader should know."""

    design: Design
    space: Space
    plan: Plan
    notes: tuple[str, ...]


def design_file(
    job: DesignJob, choose: Callable[[Plan | Campaign], Model], reference: Callable[[Plan | Campaign], str],
    progress: Progress = silent,
) -> Proposal:  # fmt: skip
    """Read, design, and make a plan of it.

    Parameters
    ----------
    job
        What is asked.
    choose
        Gives the model, effects included, for what was read.
    reference
        Gives the name that finds this model in a plan, without effects.
    progress
        Told what is being done.

    Raises
    ------
    InputError
        If files, names and numbers don't fit together.
    """
    if len(job.rivals) > 2:
        raise InputError.of("--separate", f"{len(job.rivals)} effects", "Name one or two")
    read: list[Plan | Campaign] = []

    def chosen(what: Plan | Campaign) -> Model:
        read.append(what)
        return choose(what)

    progress("read", 0, 0, "")
    source = read_source(job.file, chosen, jobs=job.jobs, seed=job.seed)
    base = read[0] if isinstance(read[0], Plan) else _plan_of(source, reference(read[0]), job.seed)
    overhead, _ = quantity("plan, pause", base.pause, "s")
    written = read_space(job.space) if job.space else None
    if written is not None:
        overhead, _ = quantity("space, overhead", written.overhead, "s")
    budget, notes = _budget(job.budget, source, overhead)
    space = written or _default_space(source, budget, overhead, isinstance(read[0], Campaign))
    limit = reach_of(space.limits, source.model)
    plans = space.plans()
    _require_conditions(plans, source.model)
    offered = candidates(base.model_copy(update={"effects": ()}), plans, limit, overhead)
    strengths = [name for effect in job.rivals for name in strength(effect)]
    own = [name for name in source.space.names if name not in strengths]
    free = [name for name in own if name not in source.calibrated]
    values = at_values(source.space, _quiet(source, job.rivals), job.at)
    points = (
        of_run(open_result(job.run), source.space, values, job.points, job.seed)
        if job.run is not None
        else around(source.space, values, tuple(free), job.points, job.seed)
    )
    lasting = [name for name in free if name not in {p.name for effect in job.rivals for p in effect.parameters}]
    names = job.parameters or tuple(job.combination) or tuple(lasting)
    criterion = job.criterion or ("c" if job.combination or len(job.parameters) == 1 else "D")
    aim = (
        rivalry(source.space, points, job.rivals, job.robust)
        if job.rivals
        else goal(criterion, source.space.names, names, job.combination, job.robust)
    )
    found = design(
        tell(source, points, job.jobs), offered, limit, aim, names, budget,
        fresh=job.fresh, jobs=job.jobs, progress=progress,
    )  # fmt: skip
    return Proposal(found, space, _programme_plan(base, found), (*source.notes, *notes))


def _quiet(source: Source, effects: Sequence[Effect]) -> np.ndarray:
    """Values of the source with rival effects that do not act."""
    names = source.space.names
    neutral = neutral_values(source.model, effects, dict(zip(names, source.values.tolist(), strict=True)))
    return np.array([neutral[name] for name in names])


def _budget(given: Quantity | None, source: Source, overhead: float) -> tuple[float, list[str]]:
    if given is None:
        longest = max(test.seconds for test in source.main or source.tests)
        return longest + overhead, [
            f"No --budget: the time of the longest test of the file, {longest:.4g} s, is taken."
        ]
    budget, _ = quantity("--budget", float(given) if _is_number(given) else given, "s")
    if not budget > 0:
        raise InputError.of("--budget", f"{given} is not above 0", "Give a time, like '120 s'")
    return budget, []


def _is_number(value: Quantity) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True


def _default_space(source: Source, budget: float, overhead: float, measured: bool) -> Space:
    """Tests within what the file's tests show that the rig can do."""
    driven, unit = driven_input(source.model)
    known = [test.procedure for test in source.tests if driven in test.procedure.inputs]
    shown = reach_shown([asked(procedure, driven, measured) for procedure in known])
    frequencies = [procedure.frequency for procedure in known if procedure.frequency]
    taken = {kind for stage in source.model.stages for kind in stage.procedures}
    kinds = [kind for kind in ("sine", "multisine", "chirp", "step") if kind not in taken or kind == "step"]
    return default_space(shown, unit, frequencies, budget, overhead, kinds)


def _require_conditions(plans: Sequence[TestPlan], model: Model) -> None:
    """A condition that the model does not know cannot make a difference, and would be believed to."""
    known = [condition.name for condition in model.conditions]
    unknown = {name for plan in plans for name in plan.conditions if name not in known}
    raise_errors(
        Fault(f"space, condition '{name}'", f"model '{model.name}' does not depend on it", did_you_mean(name, known))
        for name in sorted(unknown)
    )


def _plan_of(source: Source, reference: str, seed: int) -> Plan:
    """A plan that runs tests like those of a campaign, at the values and with the noise seen there."""
    conditions: dict[str, Quantity] = {**source.tests[0].procedure.conditions}
    noise = {name: NoisePlan(**vars(entry)) for name, entry in source.noise.items()}
    blank = TestPlan(
        name="none", kind="step", sample_rate=1.0, amplitude=1.0, periods=None, ramp_rate=1.0, duration=1.0
    )
    return Plan(
        title=f"after {source.name}",
        model=reference,
        seed=seed,
        parameters={name: float(value) for name, value in zip(source.space.names, source.values, strict=True)},
        conditions=conditions,
        noise=noise,
        tests=(blank,),
    )


def _programme_plan(base: Plan, found: Design) -> Plan:
    """The programme alone, as a plan of the same rig."""
    tests = tuple(
        candidate.plan if number == 0 else candidate.plan.model_copy(update={"name": f"{candidate.name}_{number + 1}"})
        for candidate, times in found.programme
        for number in range(times)
    )
    return base.model_copy(update={"title": f"{base.title}: next tests", "tests": tests})
