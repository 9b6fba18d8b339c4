"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mofit.data import Campaign
from mofit.diagnosis.accounts import Account
from mofit.diagnosis.candidates import Candidate, choose_effects, prepare, ranged, rescaled
from mofit.diagnosis.conclusion import Conclusion, conclude
from mofit.diagnosis.cross_validation import cross_validate
from mofit.diagnosis.fitting import Fitted, baseline_in_wide_ranges, fit_baseline
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.model_search import Attribution, attribute, with_final_estimates
from mofit.diagnosis.next_experiment import next_experiment
from mofit.diagnosis.refit import CandidateModel, share_left
from mofit.diagnosis.residual_map import ResidualMap, homogeneity, residual_map
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.result import Diagnosis
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.whitened_data import WhitenedData, with_discrepancy
from mofit.identification.inputs import as_campaign, as_model, as_names
from mofit.identification.problem_setup import choose_tests
from mofit.identification.settings import Settings
from mofit.models import Effect, Model, build_system
from mofit.runtime.progress import Progress, silent
from mofit.simulation import objective_pairs
from mofit.simulation.ranges import data_scales

_TOO_STIFF = "its integration diverges: too stiff for these sampling intervals; sample faster"


def diagnose(
    campaign: Campaign | str | Path,
    model: Model | str,
    effects: str | Sequence[str] = (),
    settings: Settings | None = None,
    *,
    tests: str | Sequence[str] = (),
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
        Name or names of candidates: all shipped ones that fit if none is named; files (``path/to/file.py:Name``) join
        them.
    settings
        Bounds, fixed parameters, seed, threads; the rest is for identifications.
    tests
        Name or names of the tests; all of the model's kinds if none is named.
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
    began = time.process_time()
    campaign, model = as_campaign(campaign), as_model(model)
    settings, rules = settings or Settings(), diagnosis or DiagnosisSettings()
    build_system(model)  # what is wrong with it is told before anything else
    tests = choose_tests(model, campaign, as_names(tests))
    selected = campaign.select(tests)
    named, left_out = choose_effects(model, selected, as_names(effects))
    scales = data_scales(model, selected)
    chosen = [ranged(effect, scales, settings.bounds) for effect in named]
    of_effects = {parameter.name for effect in chosen for parameter in effect.parameters}
    own = {name: bounds for name, bounds in settings.bounds.items() if name not in of_effects}
    settings = replace(settings, bounds=own)
    progress("baseline", 0, 1, "the model without effects")
    baseline, notes = baseline_in_wide_ranges(model, campaign, settings, tests, simulators)
    observed = baseline.hypothesis.observed
    case, ignored = _investigate(baseline, chosen, rules, progress), 0.0
    if case.conclusion.verdict == "unknown" and case.before.largest_of_peak > rules.coarse:
        case, ignored = _relaxed(case, observed, chosen, settings.seed, progress)
    found, conclusion, candidates = case.found, case.conclusion, case.candidates
    if ignored > 0 or found.best_residuals.p_value < rules.residual_p_value:
        remainder = float(np.hypot(ignored, case.after.relative))
        found = with_final_estimates(found, observed, remainder, conclusion.indistinguishable)
        share = share_left(found.best.fitted, found.baseline)
        conclusion = conclude(found, case.before, case.after, case.settings, share)
        candidates = rescaled(candidates, *(one.baseline.hypothesis.observed for one in (case.found, found)))
    reason = _why_no_shrinkage(conclusion, found)
    progress("held-out tests", 0, 1, "")
    shrinkage = reason or cross_validate(found, candidates, settings.seed)
    # models that do not explain the gap need no discrimination
    undecided = () if conclusion.verdict == "unknown" else case.undecided
    return Diagnosis(
        campaign=campaign.title,
        source=campaign.source,
        conclusion=conclusion,
        attribution=found,
        before=case.before,
        after=case.after,
        homogeneity=tuple(homogeneity(case.found.baseline)),
        shrinkage=None if isinstance(shrinkage, str) else shrinkage,
        shrinkage_reason=shrinkage if isinstance(shrinkage, str) else "",
        next_experiment=next_experiment(observed, undecided, rules.next_experiment),
        nrmsd_before=_nrmsd(found.baseline),
        nrmsd_after=_nrmsd(found.best.fitted),
        noise_floor=dict(zip(observed.problem.objective_names, map(float, observed.problem.noise.floor), strict=True)),
        left_out={**left_out, **case.stiff},
        accounts=(*found.accounts, *(Account(name, "could not be fitted", why) for name, why in case.stiff.items())),
        warnings=(*notes, *_at_ends(found), *_at_most(found, rules)),
        seconds=time.process_time() - began,
        page=_page,
    )


@dataclass(frozen=True)
class _Case:
    """One pass through score tests, refits and conclusion."""

    settings: DiagnosisSettings
    candidates: Sequence[Candidate]
    stiff: Mapping[str, str]
    found: Attribution
    before: ResidualMap
    after: ResidualMap
    conclusion: Conclusion

    @property
    def undecided(self) -> tuple[CandidateModel, ...]:
        """Models for a next experiment: where some are indistinguishable, those, and others that are not ruled out.

        One that has all the effects of an indistinguishable one, and more, cannot be discriminated from it. With the
        effect present in the calibration tests or not: both count.
        """
        equal, limit = self.conclusion.indistinguishable, self.found.best.criterion + self.settings.possible
        if len(equal) < 2:
            return equal
        known = {one.effects for one in equal} | {()}
        others = [one for one in self.found.models if one.effects not in known and one.criterion < limit]
        others = [one for one in others if not any({*few.effects} < {*one.effects} for few in equal)]
        ways = [one.alternative for one in (*equal, *others) if one.alternative is not None]
        return (*equal, *others, *(one for one in ways if one.criterion < limit))

    def with_single_effects(self, settings: DiagnosisSettings) -> _Case:
        """The same with models of at most one effect."""
        single = tuple(one for one in self.found.models if len(one.effects) < 2)
        found = replace(self.found, models=single, best_residuals=residual_tests(single[0].fitted))
        after = residual_map(single[0].fitted)
        conclusion = conclude(found, self.before, after, settings)
        return replace(self, settings=settings, found=found, after=after, conclusion=conclusion)

    @property
    def dominated(self) -> bool:
        """Whether one effect is named and any other alone leaves several times as much of the gap's squares."""
        left: dict[tuple[str, ...], float] = {
            one.effects: sum(residual_map(one.fitted).squares.values())
            for one in self.found.models
            if len(one.effects) == 1
        }
        best = left.pop(self.found.best.effects, np.inf)
        next_best = min(left.values(), default=np.inf)
        return self.conclusion.verdict == "effect" and self.settings.coarse_factor * best < next_best


def _investigate(baseline: Fitted, effects: Sequence[Effect], settings: DiagnosisSettings, progress: Progress) -> _Case:
    prepared = []
    for number, effect in enumerate(effects):
        progress("score test", number, len(effects), effect.name)
        prepared.append(prepare(baseline, effect))
    candidates = [candidate for candidate in prepared if candidate.integrates]
    stiff = {candidate.name: _TOO_STIFF for candidate in prepared if not candidate.integrates}
    found = attribute(baseline, candidates, settings, progress)
    before, after = residual_map(baseline), residual_map(found.best.fitted)
    return _Case(settings, candidates, stiff, found, before, after, conclude(found, before, after, settings))


def _relaxed(
    case: _Case, observed: WhitenedData, effects: Sequence[Effect], seed: int, progress: Progress
) -> tuple[_Case, float]:
    """The relaxed criterion: one effect that explains most of a large gap, judged by the noise or by more than that.

    Returns the case unchanged where there is none, and the discrepancy that was counted as noise, relative to the
    output's range.
    """
    settings = case.settings.relaxed(float(case.before.largest_of_peak))
    single = case.with_single_effects(settings)
    if single.dominated:
        return single, 0.0
    ignored = settings.resolution * case.before.relative
    noisy, here = with_discrepancy(observed, ignored), single.found.baseline.minimum.point
    again = _investigate(fit_baseline(noisy, here, seed), effects, settings, progress)
    return (again, ignored) if again.dominated else (case, 0.0)


def _at_ends(found: Attribution) -> tuple[str, ...]:
    """What to know of the best model's parameters that lie at the end of their range."""
    best = found.best.fitted
    bounds = zip(best.hypothesis.space.parameters, best.minimum.at_bound, strict=True)
    return tuple(
        f"{one.name} is at the end of its range, {one.lower if side < 0 else one.upper:.4g} {one.unit}: read what is "
        "named with care, or widen it with --bounds."
        for one, side in bounds
        if side and (one.lower if side < 0 else one.upper) != one.neutral
    )


def _at_most(found: Attribution, rules: DiagnosisSettings) -> tuple[str, ...]:
    """What to know where the search ended although something is left."""
    tried = len(found.best.effects)
    if tried < rules.most_effects or found.best_residuals.p_value >= rules.residual_p_value:
        return ()
    return (f"No more than {tried} effects are tried at once, and more than noise is left: there may be one more.",)


def _why_no_shrinkage(conclusion: Conclusion, found: Attribution) -> str:
    """Why the shrinkage is not reported; empty if it is."""
    if conclusion.verdict == "none":
        return "there is no gap"
    if conclusion.verdict == "unknown":
        return "none of the known effects explains the gap"
    if len(found.baseline.hypothesis.observed.problem.tests) < 2:
        return "there is only one test, so none can be left out"
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
