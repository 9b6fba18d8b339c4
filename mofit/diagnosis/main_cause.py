"""One pass through score tests, refits and conclusion; and where that explains the gap by nothing, its main cause."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit.diagnosis.baseline import fit_baseline, with_noise_of
from mofit.diagnosis.beside import prepared
from mofit.diagnosis.candidate_model import CandidateModel, probabilities_of_causes, share_left
from mofit.diagnosis.candidates import Candidate, rescaled
from mofit.diagnosis.conclusion import Conclusion, conclude
from mofit.diagnosis.fitting import Fitted, fit_to
from mofit.diagnosis.model_search import Attribution, attribute
from mofit.diagnosis.residual_map import ResidualMap, residual_map
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.whitened_data import WhitenedData, whiten, with_discrepancy
from mofit.models import Effect
from mofit.runtime.progress import Progress

#: Share of its power to which the noise of a record falls where a gap was part of it; rounds in which it is found, and
#: fits of the best effects in each.
_PART_WAS_GAP, _NOISE_ROUNDS, _FITS = 0.5, 2, 5
#: Share of what a main cause must explain below which none does in another metric either.
_LEAST = 0.5
_TOO_STIFF = "its integration diverges: too stiff for these sampling intervals; sample faster"


@dataclass(frozen=True)
class Case:
    """One pass through score tests, refits and conclusion.

    Parameters
    ----------
    ignored
        Discrepancy that was counted as noise, relative to the output's range.
    is_main
        Whether the best model is a main cause: it leaves something, and stands out.
    """

    settings: DiagnosisSettings
    candidates: Sequence[Candidate]
    stiff: Mapping[str, str]
    found: Attribution
    before: ResidualMap
    after: ResidualMap
    conclusion: Conclusion
    ignored: float = 0.0
    is_main: bool = False

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

    def with_fewer_effects(self, most: int) -> Case:
        """The same with models of at most so many effects."""
        models = tuple(one for one in self.found.models if len(one.effects) <= most)
        found = replace(self.found, models=models, best_residuals=residual_tests(models[0].fitted))
        after = residual_map(models[0].fitted)
        return replace(self, found=found, after=after, conclusion=conclude(found, self.before, after, self.settings))


def investigate(
    baseline: Fitted, effects: Sequence[Effect], settings: DiagnosisSettings, seed: int, progress: Progress
) -> Case:
    """Test, refit and compare the effects; conclude.

    The noise of a record that does not repeat is what past inputs do not predict: part of a gap may be in it, as one
    that drifts, or all of it. Where the best effects show that, all is done again with the noise that they leave, if
    that makes the records more probable.
    """
    case = _investigated(baseline, effects, settings, progress)
    for _ in range(_NOISE_ROUNDS):
        without, best = case.found.baseline, case.found.best
        observed = without.hypothesis.observed
        if not observed.predicted_only.any():
            break
        explained = [best.fitted] if best.effects else []
        if not best.effects or share_left(best.fitted, without) > 1 - settings.partly:
            explained.append(_best_by_squares(without, effects, settings, seed, progress))
        quieter = min((_with_noise_left(one, observed) for one in explained), key=_log_power)
        if quieter is observed or _log_power(quieter) >= _log_power(observed):
            break
        case = _investigated(fit_baseline(quieter, without.minimum.point, seed), effects, settings, progress)
    return case


def _best_by_squares(
    baseline: Fitted, effects: Sequence[Effect], settings: DiagnosisSettings, seed: int, progress: Progress
) -> Fitted:
    """The best effect where all lines of a record that does not repeat count alike; the baseline where none helps.

    A noise that holds the gap itself hides every effect, or lets one explain it only where the gap is small.
    """
    known = baseline.hypothesis.observed
    alike = whiten(known.problem, known.calibrations, known.simulators)
    again = fit_baseline(alike, baseline.minimum.point, seed)
    candidates = _integrating(prepared(again, effects, progress))
    return attribute(again, candidates, settings, progress, promising_only=True).best.fitted


def _with_noise_left(fitted: Fitted, observed: WhitenedData) -> WhitenedData:
    """The tests with the noise that a fit leaves, itself fitted with that noise, as long as it falls."""
    for _ in range(_FITS):
        quieter = with_noise_of(fitted)
        if not _falls(observed, quieter):
            break
        observed, fitted = quieter, fit_to(quieter, fitted)
    return observed


def _log_power(observed: WhitenedData) -> float:
    """Of the noise, summed over all lines: the smaller it is, the more probable are the records."""
    return float(sum(np.log(w.process.spectrum).mean() * w.count for *_, w in observed.records))


def _falls(before: WhitenedData, after: WhitenedData) -> bool:
    """Whether the noise of any record falls to a part of its power."""
    pairs = zip(before.records, after.records, strict=True)
    powers = ((old.process.spectrum.mean(), new.process.spectrum.mean()) for (*_, old), (*_, new) in pairs)
    return any(new < _PART_WAS_GAP * old for old, new in powers)


def _investigated(baseline: Fitted, effects: Sequence[Effect], settings: DiagnosisSettings, progress: Progress) -> Case:
    every = prepared(baseline, effects, progress)
    stiff = {candidate.name: _TOO_STIFF for candidate in every if not candidate.integrates}
    found = attribute(baseline, _integrating(every), settings, progress)
    return _with_one_effect(_case(settings, _integrating(every), stiff, found))


def _with_one_effect(case: Case) -> Case:
    """The case with one effect alone where that explains the gap, and several leave something significant, too.

    Then none is exact, and others beside it follow what its law misses.
    """
    several = case.found.best.effects
    if len(several) < 2 or case.found.best_residuals.p_value >= case.settings.residual_p_value:
        return case
    alone = case.with_fewer_effects(1)
    if alone.conclusion.verdict != "effect":
        return case
    (name,) = alone.found.best.effects
    why = f"not named, as {name} alone explains the gap and several are not exact either"
    accounts = tuple(
        replace(one, reason=f"{one.reason}; {why}") if one.name in several and one.name != name else one
        for one in case.found.accounts
    )
    return replace(alone, found=replace(alone.found, accounts=accounts))


def _integrating(candidates: Sequence[Candidate]) -> list[Candidate]:
    return [one for one in candidates if one.integrates]


def _case(
    settings: DiagnosisSettings, candidates: Sequence[Candidate], stiff: Mapping[str, str], found: Attribution
) -> Case:
    before, after = residual_map(found.baseline), residual_map(found.best.fitted)
    return Case(settings, candidates, stiff, found, before, after, conclude(found, before, after, settings))


def main_causes(case: Case, seed: int, progress: Progress) -> Iterator[Case]:
    """Main causes of a gap that nothing explains: as few effects as stand out.

    Where none does, the noise may hide it: most of the weight lies on the lines with the least noise, though what a
    model misses is no smaller there. So the last one is looked for with a part of the gap counted as noise.
    """
    for most in range(1, len(case.found.best.effects) + 1):
        fewer = case.with_fewer_effects(most)
        if stands_out(fewer.found, case.settings):
            yield replace(fewer, is_main=True)
    ignored = case.settings.resolution * case.before.relative
    baseline = case.found.baseline
    observed = baseline.hypothesis.observed
    noisy = with_discrepancy(observed, ignored)
    fitted = fit_baseline(noisy, baseline.minimum.point, seed)
    candidates = rescaled(case.candidates, observed, noisy)
    least = _LEAST * case.settings.partly
    found = attribute(fitted, candidates, case.settings, progress, promising_only=True, explaining=least)
    if stands_out(found, case.settings):
        yield replace(_case(case.settings, candidates, case.stiff, found), ignored=ignored, is_main=True)


def stands_out(found: Attribution, settings: DiagnosisSettings) -> bool:
    """Whether the best model explains most of the gap, and any other without one of its causes far less.

    Of single causes others may explain about as much if that is most of the gap, too: a cause that is more probable
    than all of them together stands out with them as its `rivals`.
    """
    best, baseline = found.best, found.baseline
    others = [one for one in found.models if not best.families <= one.families]
    if not others or share_left(best.fitted, baseline) > 1 - settings.partly:
        return False
    near = rivals(found, settings)
    if not near or len(best.effects) > 1:
        return not near
    if max(share_left(one.fitted, baseline) for one in near) > 1 - settings.partly:
        return False
    weights = probabilities_of_causes(found.models, baseline)
    own = sum(weight for weight, one in zip(weights, found.models, strict=True) if best.families <= one.families)
    return bool(own > 0.5)


def rivals(found: Attribution, settings: DiagnosisSettings) -> tuple[CandidateModel, ...]:
    """Models without one of the best model's causes that leave not much more than it does."""
    best, baseline = found.best, found.baseline
    limit = settings.dominance * share_left(best.fitted, baseline)
    others = [one for one in found.models if not best.families <= one.families]
    return tuple(one for one in others if share_left(one.fitted, baseline) <= limit)
