"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign
from mofit.diagnosis.agreement import Agreement, agreements
from mofit.diagnosis.baseline import Fitted, fit_baseline, pose
from mofit.diagnosis.candidates import Candidate, choose_effects, prepare
from mofit.diagnosis.estimate import counting_remainder, scaled, share_left
from mofit.diagnosis.locate import Where, locate
from mofit.diagnosis.next_test import NextTest, next_test
from mofit.diagnosis.observed import Observed, with_discrepancy
from mofit.diagnosis.refit import Explanation
from mofit.diagnosis.remaining import remaining
from mofit.diagnosis.several import Attribution, attribute
from mofit.diagnosis.shrink import Shrinkage, shrink
from mofit.diagnosis.thresholds import Thresholds
from mofit.diagnosis.verdict import Conclusion, conclude
from mofit.diagnosis.workshop import Workshop
from mofit.model import Effect, Model
from mofit.progress import Progress, silent
from mofit.settings import Settings

Array = NDArray[np.float64]

_TOO_STIFF = "what it adds runs away: too stiff to integrate between these samples; sample faster"


@dataclass(frozen=True)
class Diagnosis:
    """All that was found; see the modules of the parts. In a notebook it shows its page.

    Parameters
    ----------
    campaign, source
        Title and source of the campaign.
    conclusion
        Verdict, sentence, effects, group.
    attribution
        Every candidate and every explanation that was tried, with the fits of `mofit.diagnosis.estimate`.
    before, after
        The gap located, without effects and with the best explanation.
    agreements
        Whether single tests agree on the model's parameters.
    shrinkage, shrinkage_reason
        How far the gap shrinks, or why that is not said.
    next_test
        What would tell alike explanations apart.
    nrmsd_before, nrmsd_after, noise_floor
        Per test.
    left_out
        Effects that could not be candidates, and why.
    seconds
        Processor time.
    """

    campaign: str
    source: str
    conclusion: Conclusion
    attribution: Attribution
    before: Where
    after: Where
    agreements: tuple[Agreement, ...]
    shrinkage: Shrinkage | None
    shrinkage_reason: str
    next_test: NextTest | None
    nrmsd_before: Mapping[str, float]
    nrmsd_after: Mapping[str, float]
    noise_floor: Mapping[str, float]
    left_out: Mapping[str, str]
    seconds: float = field(compare=False)

    def _repr_html_(self) -> str:
        from mofit.diagnosis.page_data import diagnosis_page

        return diagnosis_page(self)._repr_html_()


def diagnose(
    campaign: Campaign,
    model: Model,
    effects: Sequence[str] = (),
    settings: Settings | None = None,
    *,
    tests: Sequence[str] = (),
    thresholds: Thresholds | None = None,
    workshop: Workshop | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose the gap between a campaign and a model.

    Parameters
    ----------
    campaign
        The measurements.
    model
        The model without effects.
    effects
        Candidates: all shipped ones that fit if none is named; files (``path/to/file.py:Name``) join them.
    settings
        Bounds, fixed parameters, seed, threads; the rest is for identifications.
    tests
        Names of the tests; all of the model's kinds if none is named.
    thresholds
        Where lines are drawn.
    workshop
        Keeps compiled models from one campaign to the next.

    Raises
    ------
    InputError
        If campaign, model and effects don't fit together.
    """
    began = time.process_time()
    settings, thresholds = settings or Settings(), thresholds or Thresholds()
    observed, start = pose(model, campaign, settings, tests, workshop)
    chosen, left_out = choose_effects(model, campaign.select(observed.problem.tests), effects)
    case, ignored = _investigate(observed, start, chosen, settings, thresholds, progress), 0.0
    if case.conclusion.verdict == "unknown" and case.coarseness > thresholds.coarse:
        roughly = thresholds.roughly(case.coarseness)
        again = case.singly(roughly)
        if not again.leads(thresholds.coarse_lead):
            ignored = thresholds.resolution * case.before.relative
            rough = with_discrepancy(observed, ignored)
            here = case.found.baseline.minimum.point
            again = _investigate(rough, here, chosen, settings, roughly, progress)
        case, ignored = (again, ignored) if again.leads(thresholds.coarse_lead) else (case, 0.0)
    found, conclusion, candidates = case.found, case.conclusion, case.candidates
    if ignored > 0 or found.best_left.p < thresholds.left:
        remainder = float(np.hypot(ignored, case.after.relative))
        found = counting_remainder(observed, remainder, found, conclusion.alike)
        conclusion = conclude(found, case.before, case.after, case.thresholds, share_left(found))
        candidates = scaled(candidates, *(one.baseline.hypothesis.observed for one in (case.found, found)))
    reason = _why_not(conclusion, found, thresholds)
    progress("shrink", 0, 1, "")
    shrinkage = None if reason else shrink(found, candidates, settings.seed)
    if not reason and shrinkage is None:
        reason = "what was fitted without one of the tests is too stiff to be integrated in it; sample it faster"
    return Diagnosis(
        campaign=campaign.title,
        source=campaign.source,
        conclusion=conclusion,
        attribution=found,
        before=case.before,
        after=case.after,
        agreements=tuple(agreements(case.found.baseline)),
        shrinkage=shrinkage,
        shrinkage_reason=reason,
        # explanations that do not explain need no parting
        next_test=None if conclusion.verdict == "unknown" else next_test(observed, case.doubtful),
        nrmsd_before=nrmsd(found.baseline),
        nrmsd_after=nrmsd(found.best.fitted),
        noise_floor=dict(zip(observed.problem.tests, map(float, observed.problem.noise.floor), strict=True)),
        left_out={**left_out, **case.stiff},
        seconds=time.process_time() - began,
    )  # fmt: skip


@dataclass(frozen=True)
class _Case:
    """One pass through screen, refits and conclusion."""

    thresholds: Thresholds
    candidates: Sequence[Candidate]
    stiff: Mapping[str, str]
    found: Attribution
    before: Where
    after: Where
    conclusion: Conclusion

    @property
    def coarseness(self) -> float:
        """Largest gap of a test relative to its output's peak."""
        where = self.before
        return max(np.sqrt(max(square, 0.0)) / where.peaks[test] for test, square in where.squares.items())

    @property
    def doubtful(self) -> tuple[Explanation, ...]:
        """Explanations for a next test to part: where some are alike, those, and others that are not ruled out.

        One that has all the effects of one alike, and more, cannot be parted from it. In the calibration tests or not:
        both ways count.
        """
        alike, limit = self.conclusion.alike, self.found.best.criterion + self.thresholds.possible
        if len(alike) < 2:
            return alike
        known = {one.effects for one in alike} | {()}
        others = [one for one in self.found.explanations if one.effects not in known and one.criterion < limit]
        others = [one for one in others if not any({*few.effects} < {*one.effects} for few in alike)]
        ways = [one.other_way for one in (*alike, *others) if one.other_way is not None]
        return (*alike, *others, *(one for one in ways if one.criterion < limit))

    def singly(self, thresholds: Thresholds) -> _Case:
        """The same with explanations of one effect alone."""
        single = tuple(explanation for explanation in self.found.explanations if len(explanation.effects) < 2)
        found = replace(self.found, explanations=single, best_left=remaining(single[0].fitted))
        after = locate(single[0].fitted)
        conclusion = conclude(found, self.before, after, thresholds)
        return replace(self, thresholds=thresholds, found=found, after=after, conclusion=conclusion)

    def leads(self, factor: float) -> bool:
        """Whether one effect is named and any other alone leaves so many times as much of the gap's squares."""
        left: dict[tuple[str, ...], float] = {
            explanation.effects: sum(locate(explanation.fitted).squares.values())
            for explanation in self.found.explanations
            if len(explanation.effects) == 1
        }
        best = left.pop(self.found.best.effects, np.inf)
        return self.conclusion.verdict == "effect" and factor * best < min(left.values(), default=np.inf)


def _investigate(
    observed: Observed,
    start: Array,
    effects: Sequence[Effect],
    settings: Settings,
    thresholds: Thresholds,
    progress: Progress,
) -> _Case:
    progress("baseline", 0, 1, "the model without effects")
    baseline = fit_baseline(observed, start, settings.seed)
    prepared = []
    for number, effect in enumerate(effects):
        progress("screen", number, len(effects), effect.name)
        prepared.append(prepare(baseline, effect))
    candidates = [candidate for candidate in prepared if candidate.integrates]
    stiff = {candidate.name: _TOO_STIFF for candidate in prepared if not candidate.integrates}
    found = attribute(baseline, candidates, thresholds, progress)
    before, after = locate(baseline), locate(found.best.fitted)
    return _Case(thresholds, candidates, stiff, found, before, after, conclude(found, before, after, thresholds))


def _why_not(conclusion: Conclusion, found: Attribution, thresholds: Thresholds) -> str:
    """Why the shrinkage is not said; empty if it is."""
    if conclusion.verdict == "none":
        return "there is no gap"
    if conclusion.verdict == "unknown":
        return "none of the known effects explains the gap"
    if len(found.baseline.hypothesis.observed.problem.tests) < 2:
        return "a single test leaves nothing to hold out"
    return ""


def nrmsd(fitted: Fitted) -> dict[str, float]:
    """NRMSD per test over the judged samples, all outputs together."""
    model, problem = fitted.hypothesis, fitted.hypothesis.observed.problem
    stored = model.simulator.sensitivities(model.full(fitted.minimum.point[None]))
    found = {}
    for name, drive, (output, _) in zip(problem.tests, problem.drives, stored, strict=True):
        squares = drive.weights * (drive.measured - output[0]) ** 2
        found[name] = float(np.sqrt(squares.sum() / np.count_nonzero(drive.weights)))
    return found
