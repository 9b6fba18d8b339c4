"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mofit.data import Campaign
from mofit.data.set_points import at_set_points
from mofit.diagnosis.accounts import Account
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.candidate_model import share_left
from mofit.diagnosis.candidates import choose_effects, ranged, rescaled
from mofit.diagnosis.conclusion import Conclusion, conclude, replaced_by_term
from mofit.diagnosis.final_estimates import with_final_estimates
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.gap_under_conditions import gaps_under_conditions
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.main_cause import Case, investigate, main_causes, rivals, stands_out
from mofit.diagnosis.measured_shrinkage import measured_shrinkage
from mofit.diagnosis.missing_laws import missing_laws
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.motion_scales import motion_scales
from mofit.diagnosis.next_experiment import next_experiment
from mofit.diagnosis.notes import at_ends, at_most, of_noise, of_tests
from mofit.diagnosis.proposal import Proposal, propose
from mofit.diagnosis.residual_map import homogeneity
from mofit.diagnosis.result import Diagnosis
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.shrinkage import Shrinkage
from mofit.diagnosis.whitened_data import MOST_PROCESSES, WhitenedData
from mofit.identification.allowance import SIMULATIONS_SPENT, all_simulated, simulations_told
from mofit.identification.held_out import of_conditions, remaining_tests, without_held_out
from mofit.identification.inputs import as_campaign, as_effects, as_model, as_names
from mofit.identification.settings import Settings
from mofit.models import Effect, Model, build_system
from mofit.runtime.parallel import may_fork, processor_time
from mofit.runtime.progress import Progress, silent
from mofit.runtime.team import is_first, team
from mofit.simulation import objective_pairs
from mofit.simulation.evaluation.evaluations import evaluations_of, with_evaluations
from mofit.simulation.evaluation.executors import evaluated_in
from mofit.simulation.ranges import data_scales, with_parameters


def diagnose(
    campaign: Campaign | str | Path,
    model: Model | str,
    effects: Effect | str | Sequence[Effect | str] = (),
    settings: Settings | None = None,
    *,
    tests: str | Sequence[str] = (),
    hold_out: str | Sequence[str] = (),
    diagnosis: DiagnosisSettings | None = None,
    simulators: SimulatorCache | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose the gap between a campaign and a model.

    Parameters
    ----------
    campaign
        The measurements, or the path of their file.
    model
        The model without effects, or its name: a shipped one's, or ``path/to/file.py:Name``.
    effects
        Candidates or their names: all shipped ones that fit if none is named; effects and files
        (``path/to/file.py:Name``) join them.
    settings
        Bounds, fixed parameters, scopes, seed, threads; the rest is for identifications. Bounds and scopes may be those
        of effects, too.
    tests
        Name or names of the tests; all of the model's kinds if none is named.
    hold_out
        Name or names of tests that are not used at all, but predicted once all is done: how far the gap shrinks is
        measured on them.
    diagnosis
        Settings of the method.
    simulators
        Keeps compiled models from one campaign to the next.
    progress
        Called at the start of every step.

    Raises
    ------
    InputError
        If campaign, model and effects don't fit together.
    """
    began = processor_time()
    campaign, model = as_campaign(campaign), _unpooled(as_model(model))
    settings, rules = (settings or Settings()).for_model(model), diagnosis or DiagnosisSettings()
    model = with_evaluations(model, settings.simulations)
    build_system(model)  # what is wrong with it is told before anything else
    evaluations, jobs = evaluations_of(model), simulators.jobs if simulators else settings.jobs
    # each process of a team would count its simulations for itself
    processes = min(jobs, MOST_PROCESSES) if evaluations is None and may_fork() else 1
    with evaluated_in(evaluations, settings.jobs, settings.timeout, settings.dask), team(processes):
        found = _diagnosed(
            campaign, model, as_effects(effects), settings, as_names(tests),
            of_conditions(campaign, as_names(hold_out)), rules, simulators,
            progress if is_first() else silent,
        )  # fmt: skip
    return replace(found, seconds=processor_time() - began)


def _diagnosed(
    campaign: Campaign,
    model: Model,
    effects: Sequence[Effect | str],
    settings: Settings,
    tests: Sequence[str],
    hold_out: Sequence[str],
    rules: DiagnosisSettings,
    simulators: SimulatorCache | None,
    progress: Progress,
) -> Diagnosis:
    """The steps of a diagnosis, in order."""
    campaign, merged = at_set_points(campaign, settings.over, settings.set_points)
    whole, campaign = campaign, without_held_out(campaign, hold_out)
    tests = remaining_tests(model, campaign, whole, tests)
    if over := settings.over:
        from mofit.identification.conditions import with_laws_of_conditions  # late: it identifies, and samples

        model, settings = with_laws_of_conditions(campaign, model, settings, tests, progress)
    records = whole.select(hold_out) if hold_out else None
    selected = campaign.select(tests)
    laws, scales = missing_laws(model, selected, over, settings.fixed), data_scales(model, selected)
    named, left_out = choose_effects(model, selected, effects, laws)
    progress("baseline", 0, 1, "the model without effects")
    baseline, notes = baseline_in_wide_ranges(model, campaign, _of_model(settings, named), tests, simulators)
    chosen = [
        ranged(effect, scales | moved, settings.bounds, settings.scopes)
        for effect, moved in zip(named, motion_scales(baseline, named, scales), strict=True)
    ]
    first = investigate(baseline, chosen, rules, settings.seed, progress)
    observed = first.found.baseline.hypothesis.observed
    case, ending = _graded(first, observed, records, settings.seed, progress)
    proposed = _proposed(first, case, ending, settings.seed, progress)
    if isinstance(proposed, Proposal):
        ending = _with_term(ending, proposed)
    found, conclusion = ending.found, ending.conclusion
    complete = all_simulated(observed.problem)
    if not complete:
        conclusion = replace(conclusion, sentence=f"{SIMULATIONS_SPENT} {conclusion.sentence}")
    # models that do not explain the gap need no discrimination
    undecided = () if conclusion.verdict in ("partly", "unknown") else case.undecided
    return Diagnosis(
        campaign=campaign.title,
        source=campaign.source,
        conclusion=conclusion,
        attribution=found,
        before=case.before,
        after=case.after,
        under_conditions=gaps_under_conditions(case.before, selected, over),
        homogeneity=tuple(homogeneity(case.found.baseline)),
        shrinkage=ending.shrinkage,
        shrinkage_reason=ending.reason,
        proposed=proposed if isinstance(proposed, Proposal) else None,
        proposed_reason=proposed if isinstance(proposed, str) else "",
        next_experiment=next_experiment(observed, undecided, rules.next_experiment),
        nrmsd_before=_nrmsd(found.baseline),
        nrmsd_after=_nrmsd(found.best.fitted),
        noise_floor=dict(zip(observed.problem.objective_names, observed.noise_floors, strict=True)),
        left_out={**left_out, **case.stiff},
        accounts=(*found.accounts, *(Account(name, "could not be fitted", why) for name, why in case.stiff.items())),
        warnings=(
            *merged,
            *notes,
            *simulations_told(observed.problem),
            *at_ends(found),
            *at_most(found, rules),
            *of_tests(found, ending.shrinkage),
            *of_noise(observed),
        ),
        complete=complete,
        seconds=0.0,
        page=_page,
    )


def _of_model(settings: Settings, effects: Sequence[Effect]) -> Settings:
    """The settings without what they say of the effects' parameters."""
    theirs = {parameter.name for effect in effects for parameter in effect.parameters}
    bounds = {name: bounds for name, bounds in settings.bounds.items() if name not in theirs}
    scopes = {name: scope for name, scope in settings.scopes.items() if name not in theirs}
    return replace(settings, bounds=bounds, scopes=scopes)


@dataclass(frozen=True)
class _Ending:
    """The final estimates of a case, how far the gap shrinks on tests left out (or why not), and what follows."""

    found: Attribution
    conclusion: Conclusion
    shrinkage: Shrinkage | None
    reason: str


def _ending(case: Case, observed: WhitenedData, records: Campaign | None, seed: int, progress: Progress) -> _Ending:
    found, candidates, share = case.found, case.candidates, None
    if case.ignored or found.best_residuals.p_value < case.settings.residual_p_value:
        remainder = float(np.hypot(case.ignored, case.after.relative))
        # beside a main cause all others are compared by what they leave
        reported = found.models if case.is_main else case.conclusion.indistinguishable
        found = with_final_estimates(found, observed, remainder, reported, progress)
        share = share_left(found.best.fitted, found.baseline)
        candidates = rescaled(candidates, *(one.baseline.hypothesis.observed for one in (case.found, found)))
    reason = _why_no_shrinkage(case)
    progress("held-out tests", 0, 1, "")
    shrinkage, reason = (None, reason) if reason else measured_shrinkage(found, candidates, records, seed)
    removed = shrinkage.of_cause if shrinkage else 0.0
    if len(observed.problem.tests) < 2:  # what the fit to it leaves must do
        removed = 1 - share_left(found.best.fitted, found.baseline)
    main = case.is_main and stands_out(found, case.settings)
    near = rivals(found, case.settings) if main else ()
    removed = removed if main else 0.0
    before, after, rules = case.before, case.after, case.settings
    conclusion = conclude(
        found, before, after, rules, ignored=case.ignored, share=share, removed=removed, held_out=shrinkage, rivals=near
    )
    if shrinkage and conclusion.verdict == "unknown":
        shrinkage, reason = None, "the nearest of the known effects does not hold on tests left out"
    return _Ending(found, conclusion, shrinkage, reason)


def _graded(
    first: Case, observed: WhitenedData, records: Campaign | None, seed: int, progress: Progress
) -> tuple[Case, _Ending]:
    """The case with its ending; where it explains the gap by nothing, that of a main cause if there is one."""
    whole = _ending(first, observed, records, seed, progress)
    if whole.conclusion.verdict == "unknown":
        for case in main_causes(first, seed, progress):
            ending = _ending(case, observed, records, seed, progress)
            if ending.conclusion.verdict != "unknown":
                return case, ending
    return first, whole


def _proposed(first: Case, case: Case, ending: _Ending, seed: int, progress: Progress) -> Proposal | str:
    """A term where no known effect explains the gap, or why there is none."""
    verdict = ending.conclusion.verdict
    if verdict not in ("partly", "unknown"):
        return "there is no gap" if verdict == "none" else "the known effects explain the gap"
    if not case.settings.propose:
        return "it was not asked for"
    main = ending.found.best.fitted if verdict == "partly" else None
    return propose(first.found.baseline, main, case.settings, seed, progress)


def _with_term(ending: _Ending, proposed: Proposal) -> _Ending:
    """The ending with the term in its sentence; a cause that the term shows to be none is left out."""
    conclusion = ending.conclusion
    if proposed.instead and conclusion.replaceable_by(1 - proposed.removed):
        conclusion = replaced_by_term(conclusion)
        ending = replace(ending, shrinkage=None, reason="a term explains the gap better than the nearest known effect")
    return replace(ending, conclusion=replace(conclusion, sentence=f"{conclusion.sentence} {proposed.sentence}"))


def _unpooled(model: Model) -> Model:
    """The model with the values of pooled parameters free: a diagnosis asks what a test needs, not what is usual."""
    parameters = tuple(replace(one, pooled=False) for one in model.parameters)
    return model if parameters == tuple(model.parameters) else with_parameters(model, parameters)


def _why_no_shrinkage(case: Case) -> str:
    """Why the shrinkage is not reported, whatever was left out; empty if it is."""
    if case.conclusion.verdict == "none":
        return "there is no gap"
    if case.conclusion.verdict == "unknown" and not case.is_main:
        return "none of the known effects explains the gap"
    return ""


def _nrmsd(fitted: Fitted) -> dict[str, float]:
    """NRMSD per test (and output, of several) over the samples used."""
    problem, outputs = fitted.hypothesis.observed.problem, fitted.hypothesis.outputs(fitted.minimum.point[None])
    found = {}
    for name, (test, y) in zip(problem.objective_names, objective_pairs(problem.experiments), strict=True):
        weights, measured = problem.experiments[test].weights[:, y], problem.experiments[test].measured[:, y]
        squares = weights * (measured - outputs[test][0][0, :, y]) ** 2
        found[name] = float(np.sqrt(squares.sum() / np.count_nonzero(weights)))
    return found


def _page(found: Diagnosis) -> str:
    # figures take long to import, and only notebooks show this page
    from mofit.diagnosis.pages import diagnosis_page

    return diagnosis_page(found)._repr_html_()
