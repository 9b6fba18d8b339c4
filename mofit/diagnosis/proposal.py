"""Where no known effect explains the gap: terms learnt from the data, fitted jointly, and tried on tests left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidate_model import rated
from mofit.diagnosis.cross_validation import cross_validate
from mofit.diagnosis.final_estimates import with_final_estimates
from mofit.diagnosis.fitting import Fitted, averaged_over_periods, fit_to
from mofit.diagnosis.inner_signals import Target
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.residual_map import residual_map
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.shrinkage import HALF, Shrinkage
from mofit.diagnosis.term_search import in_all_periods, searched, simplest
from mofit.diagnosis.term_selection import noise_of_folds, prediction_errors
from mofit.diagnosis.term_trial import Trial, estimated
from mofit.diagnosis.terms import TermEffect
from mofit.diagnosis.whitened_data import WhitenedData, with_discrepancy
from mofit.models import TARGET_UNIT
from mofit.runtime.progress import Progress

#: Standard deviations to the ends of a 90 % interval.
_Z90 = 1.645
#: Standard deviations of the noise by which a test must be predicted worse to count.
_WORSE = 2.0
#: Of a single test.
_PARTS = "parts left out in turn"
#: Least number of folds with a gap that a term must halve, or all that show one; of fewer folds it must shrink all.
_FEWEST_FOLDS = 3
#: But never a single one: that may be chance. So many must be promised, where refits decide.
_MORE_THAN_CHANCE = 2


@dataclass(frozen=True)
class Estimate:
    """A parameter of a term with its 90 % interval; ``name`` is that in the effect file."""

    name: str
    description: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Proposal:
    """Terms that would explain a gap that no known effect explains.

    Parameters
    ----------
    effect
        The terms with their estimates as nominal values.
    beside, instead
        Names of the effects of the main cause that the terms stand beside, or that they replace.
    fitted
        The model with them, its final estimates.
    removed, low, high
        Share of the gap that goes on tests left out, of the model without any effect that these tests alone determine;
        90 % interval.
    observed
        The same against the measured samples themselves.
    held_out
        What was left out, in words: the most demanding kind at hand.
    """

    effect: TermEffect
    beside: tuple[str, ...]
    instead: tuple[str, ...]
    fitted: Fitted
    removed: float
    low: float
    high: float
    observed: float
    held_out: str

    @property
    def target(self) -> Target:
        """What the terms act on."""
        return self.effect.target

    @property
    def law(self) -> str:
        """The terms in words."""
        return _law(self.effect)

    @property
    def sentence(self) -> str:
        """What is proposed, and how far it shrinks the gap."""
        others = " and ".join(self.beside or self.instead)
        place = f" {'beside' if self.beside else 'instead of'} {others}" if others else ""
        return (
            f"Proposed term{place}, learnt from these data: {self.law}. On {self.held_out} it removes "
            f"{100 * self.removed:.1f} % of the gap ({100 * self.low:.1f} to {100 * self.high:.1f} %)."
        )

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every parameter of the terms with its interval."""
        space, point, reach = self.fitted.hypothesis.space, self.fitted.minimum.point, _Z90 * self.fitted.sd()
        low, value, high = (space.from_unit(np.clip(point + k * reach, 0.0, 1.0)) for k in (-1, 0, 1))
        units = {TARGET_UNIT: self.target.unit}
        found = []
        for one in self.effect.parameters:
            k, unit = space.index(one.name), units.get(one.unit, one.unit)
            found.append(Estimate(one.name, one.description, float(value[k]), float(low[k]), float(high[k]), unit))
        return tuple(found)


def _law(effect: TermEffect) -> str:
    return f"{effect.title}, added to {effect.target.name}"


def propose(
    baseline: Fitted, main: Fitted | None, rules: DiagnosisSettings, seed: int, progress: Progress
) -> Proposal | str:
    """Terms learnt from the data, or why none is proposed.

    Parameters
    ----------
    baseline
        The model without effects.
    main
        The model with the main cause, where there is one.
    """
    alone = baseline.hypothesis.observed.without_stages()
    noisy = with_discrepancy(alone, rules.resolution * residual_map(baseline).relative, everywhere=True)
    starts = [fit_to(noisy, one) for one in (baseline, main) if one is not None]
    nothing = prediction_errors(starts[0])
    noise = np.minimum(noise_of_folds(noisy), nothing)  # of a short record it may be overestimated
    tests = len(noisy.problem.tests)
    least = rules.residual_share * float((nothing - noise).sum())
    if not least > 0:
        return "it is not larger than the noise of the records"
    progress("proposed term", 0, 1, " + ".join(one.name for one in starts[-1].hypothesis.effects))
    trials = list[Trial]()
    for start in starts:
        trials.append(in_all_periods(start, searched(averaged_over_periods(start), least)))
        # a single term that leaves no more than the noise: no term beside the main cause is as simple
        if trials[-1].effect and trials[-1].parts == 1 and trials[-1].error <= noise.sum():
            break
    best = simplest(trials, least)
    if best.effect is None:
        return "no function of the model's inputs and states predicts it in data that were left out"
    noise = _at_most(noise, best.errors)
    shown = nothing > 2 * noise
    many, refits = len(nothing) >= _FEWEST_FOLDS, tests >= _FEWEST_FOLDS
    fewer = int(np.sum(best.errors[shown] < (HALF if many else 1.0) * nothing[shown]))
    needed = _needed(int(shown.sum())) if many else len(nothing)
    # one step from the fit to all selects, but a fit without a fold may lie far from that: refits decide
    if fewer < (_MORE_THAN_CHANCE if refits else needed):
        return _chance(
            best.effect, "halves" if many else "shrinks", fewer, len(nothing), "tests" if tests > 1 else "parts"
        )
    return _validated(starts, best, needed if refits else 0, seed)


def _needed(shown: int) -> int:
    """So many of the folds that show a gap must have it halved."""
    return int(np.clip(shown, _MORE_THAN_CHANCE, _FEWEST_FOLDS))


def _chance(effect: TermEffect, does: str, fewer: int, folds: int, what: str) -> str:
    return f"the best one ({_law(effect)}) {does} it in {fewer} of {folds} {what}: it may be chance"


def _at_most(noise: FloatArray, left: FloatArray) -> FloatArray:
    """The noise of folds, lowered to what is left of them where it is more: what can be predicted is no noise."""
    return noise * min(1.0, float(left.sum() / max(noise.sum(), np.finfo(float).tiny)))


def _validated(starts: Sequence[Fitted], best: Trial, needed: int, seed: int) -> Proposal | str:
    """The proposal with final estimates and its share on tests left out, or why it is refused.

    So many tests ``needed`` must have their gap halved when they are left out.
    """
    baseline, start = starts[0], starts[-1]
    observed, effect = baseline.hypothesis.observed, best.effect
    assert effect is not None  # there is one
    beside = tuple(one.name for one in best.fitted.hypothesis.effects if one.name != effect.name)
    others = tuple(one.name for one in start.hypothesis.effects)
    found = _final(baseline, best.fitted)
    fitted = found.best.fitted
    proposal = partial(Proposal, estimated(effect, fitted), beside, () if beside else others, fitted)
    if len(observed.problem.tests) < 2:
        return _of_parts(baseline, best, proposal)
    shrinkage = cross_validate(found, (), seed)
    alike = shrinkage.of("test")
    if alike is None:
        return shrinkage.reason
    if shrinkage.ran_away:
        return f"without {' or '.join(one.name for one in shrinkage.ran_away)} the fit of the best term runs away"
    halved = sum(one.share > HALF for one in alike.hold_outs)
    if halved < needed:
        return _chance(effect, "halves", halved, len(alike.hold_outs), "tests")
    reached = shrinkage.headline
    for one in (alike, reached):
        if one.share <= HALF:
            return _too_little(one.share, one.low, one.high, one.place)
    if shrinkage.refutes:
        tests = " and ".join(one.in_words for one in shrinkage.contradicting) or "tests left out in turn"
        return f"without the best term ({_law(effect)}), {tests} would be predicted better from the other tests"
    further = cross_validate(_final(start, best.fitted), (), seed) if beside else shrinkage
    if worse := {name: None for one in (shrinkage, further) for name in _worse(observed, one)}:
        return f"the best term makes {' and '.join(worse)} worse where left out"
    return proposal(reached.share, reached.low, reached.high, reached.observed, reached.place)


def _final(start: Fitted, fitted: Fitted) -> Attribution:
    """The two models with final estimates: what the better one leaves counts as noise."""
    models, residuals = (rated(fitted, 1), rated(start, 1)), residual_tests(fitted)
    found = Attribution(start, residual_tests(start), (), models, residuals)
    return with_final_estimates(found, start.hypothesis.observed, residual_map(fitted).relative, ())


def _too_little(removed: float, low: float, high: float, what: str) -> str:
    share = f"{100 * removed:.0f} % ({100 * low:.0f} to {100 * high:.0f} %)"
    return f"the best term removes {share} of it on {what}"


def _of_parts(baseline: Fitted, best: Trial, proposal: Callable[..., Proposal]) -> Proposal | str:
    """Of a single test: the share on parts of it that were left out, with its interval over them (jackknife)."""
    observed = baseline.hypothesis.observed
    if any(w.periods for _, _, w in observed.records):
        return "there is only one test, and it repeats: nothing can be left out"
    before, after = prediction_errors(baseline), best.errors
    noise = _at_most(np.minimum(noise_of_folds(observed), before), after)
    before, after = before - noise, after - noise
    if np.any(after > before + noise):
        return "the best term makes a part of the record worse where left out"
    removed = float(1 - after.sum() / before.sum())
    without = [1 - np.delete(after, k).sum() / np.delete(before, k).sum() for k in range(len(after))]
    reach = _Z90 * float(np.sqrt((len(without) - 1) * np.var(without)))
    low, high = removed - reach, min(removed + reach, 1.0)
    return _too_little(removed, low, high, _PARTS) if low <= 0 else proposal(removed, low, high, removed, _PARTS)


def _worse(observed: WhitenedData, shrinkage: Shrinkage) -> list[str]:
    """Hold-outs that are predicted worse with the terms than without, by more than the noise explains."""
    records = {(observed.problem.tests[test], output): i for i, (test, output, _) in enumerate(observed.records)}
    outputs = [channel.name for channel in observed.problem.model.outputs]
    variance = observed.noise_share * observed.variance
    found = []
    for hold_out in (one for share in shrinkage.shares for one in share.hold_outs):
        more, allowed = 0.0, 0.0
        for held in hold_out.predictions:
            i = records[held.test, outputs.index(held.output)]
            measured = observed.used_samples(i)
            more += float(np.sum((measured - held.after) ** 2 - (measured - held.before) ** 2))
            allowed += float(variance[observed.record == i].sum() * np.sum((held.after - held.before) ** 2))
        if more > _WORSE * 2 * np.sqrt(allowed):
            found.append(hold_out.name)
    return found
