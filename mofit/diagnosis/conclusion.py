"""The conclusion from all that was tried, by grades: nothing, a cause that explains the gap, most of it, or none."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidate_model import CandidateModel, probabilities, probabilities_of_causes
from mofit.diagnosis.effect_size import parameters_of, size_of
from mofit.diagnosis.grades import Finding, Verdict
from mofit.diagnosis.groups import follow_run_order
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.residual_map import ResidualMap
from mofit.diagnosis.sentences import (
    cause,
    contradicted,
    left_over,
    nearest,
    refuted,
    replaced,
    rig_and_model,
    unexplained,
)
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.shrinkage import Shrinkage
from mofit.models.effect import CALIBRATION_ERROR

#: Share of the gap above which a law leaves much, and share of that below which a term leaves hardly anything: an order
#: of magnitude each, as laws of about the right shape leave some per cent.
_MUCH = 0.1
#: Standard deviations to the ends of a 90 % interval.
_Z90 = 1.645
#: Families whose law has no shape, only a coefficient or none: no term refines it.
WITHOUT_SHAPE = frozenset(
    {CALIBRATION_ERROR, "compliance", "inertia", "load coupling", "sensor error", "speed error", "spin slip"}
)


@dataclass(frozen=True)
class NamedEffect:
    """An effect with its probability, its size with a 90 % interval in ``unit``, and all its fitted ``parameters``.

    ``family``: the cause that it shares with other laws. ``present_in_calibration``: whether it seems to have been
    present in the calibration tests too. ``of_rig``: whether the rig adds it, and the model does not lack it.
    """

    name: str
    title: str
    family: str
    probability: float
    size: float
    size_low: float
    size_high: float
    unit: str
    parameters: dict[str, float]
    present_in_calibration: bool
    of_rig: bool


@dataclass(frozen=True)
class NamedFamily:
    """A cause by its family, with the probability that an effect of it, whatever its law, is present."""

    name: str
    probability: float


@dataclass(frozen=True)
class Conclusion:
    """The verdict, and a sentence for people.

    Parameters
    ----------
    effects, families
        Those of the indistinguishable models: families beyond doubt first, and of these what the model lacks before
        what the rig adds; then the most probable first.
    indistinguishable
        The models with effects that the data cannot distinguish from the best, the best first.
    residual_share
        Share of the gap's mean square that the best model leaves.
    probabilities
        Of every model that was tried, in their order.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[NamedEffect, ...]
    families: tuple[NamedFamily, ...]
    indistinguishable: tuple[CandidateModel, ...]
    residual_share: float
    probabilities: tuple[float, ...]

    @property
    def group(self) -> tuple[str, ...]:
        """Names of the effects that these data cannot distinguish; empty if there is no doubt."""
        doubtful = doubtful_effects([one.effects for one in self.indistinguishable])
        return tuple(effect.name for effect in self.effects if effect.name in doubtful)

    @property
    def in_doubt(self) -> bool:
        """Whether no family is in all of the indistinguishable models: none of the causes is sure."""
        sets = [one.families for one in self.indistinguishable]
        return bool(sets) and not frozenset.intersection(*sets)

    def replaceable_by(self, left: float) -> bool:
        """Whether a term that leaves this share of the gap on tests left out shows the causes to be none.

        Of causes in doubt, or that are all `WITHOUT_SHAPE`, any does: a law that explains most of a gap may be the
        right one, which the term refines; a wrong constant, or a coupling by one coefficient, is right or is not. And a
        law is another one where it leaves more than a tenth of the gap, and the term less than a tenth of that: with a
        shape like the right one, a cubic for a hyperbolic sine, it leaves some per cent.
        """
        if not self.indistinguishable:
            return False
        without = all(one.families <= WITHOUT_SHAPE for one in self.indistinguishable)
        return self.in_doubt or without or left / _MUCH < self.residual_share > _MUCH


def doubtful_effects(sets: Sequence[Sequence[str]]) -> set[str]:
    """Effects that are in some of several sets, but not in all."""
    return {name for one in sets for name in one if not all(name in other for other in sets)}


def conclude(
    found: Attribution,
    before: ResidualMap,
    after: ResidualMap,
    settings: DiagnosisSettings,
    *,
    ignored: float = 0.0,
    share: float | None = None,
    removed: float = 0.0,
    held_out: Shrinkage | None = None,
    rivals: Sequence[CandidateModel] = (),
) -> Conclusion:
    """Draw the conclusion from the gap before and after the best model.

    Parameters
    ----------
    ignored
        Discrepancy that was counted as noise, relative to the output's range: it is significant, and left.
    share
        What the final estimates leave of the gap's mean square; the verdict on a main cause rests on it.
    removed
        See `Finding`.
    held_out
        What tests left out tell of the best model.
    rivals
        Models of other causes that explain about as much as the best, a main cause.
    """
    best = found.best
    several = len(best.effects) > 1
    limit = best.criterion + (settings.indistinguishable_of_several if several else settings.indistinguishable)
    like_best = {id(one) for one in rivals}
    equal = tuple(one for one in found.models if one.effects and (one.criterion < limit or id(one) in like_best))
    left_of_peak, left_share = _left(found, before, after, settings)
    doubtful = doubtful_effects([one.effects for one in equal])
    finding = Finding(
        effects=best.effects,
        significant=found.has_gap(settings),
        left_p_value=0.0 if ignored else found.best_residuals.p_value,
        left_of_peak=max(left_of_peak, 2 * ignored),  # a range is about two peaks
        # of a main cause the final estimates count: the noise alone bends a law that misses little to miss more
        left_share=share if removed and share is not None else left_share,
        doubtful=bool(doubtful),
        removed=removed,
        refuted=held_out is not None and held_out.refutes,
        stretched=held_out is not None and several and len(best.families) == 1 and not held_out.reaches,
        shown=held_out is None or held_out.shows_help(),
        shown_in_groups=held_out is None or held_out.shows_help("group"),
        in_time=follow_run_order(best.fitted.hypothesis.effects),
    )
    share = left_share if share is None else share
    verdict = finding.verdict(settings)
    missed = verdict in ("partly", "unknown") or bool(rivals)
    weights = probabilities_of_causes(found.models, found.baseline) if missed else probabilities(found.models)
    if verdict == "none":
        return Conclusion("none", "No gap: the residual is noise.", (), (), (), share, tuple(weights))
    effects = _named_effects(found.models, equal, weights)
    laws = [(one.family, one.title) for one in effects if one.name in best.effects]
    contradicting = [] if held_out is None else [one.in_words for one in held_out.contradicting]
    if verdict == "unknown":
        titles = [title for _, title in laws]
        if finding.refuted:
            places = [] if held_out is None else [one.place for one in held_out.leaving_most]
            near = refuted(titles, contradicting, places)
        else:
            unconfirmed = finding.stretched or finding.unshown
            near = nearest(titles, share, unconfirmed) if laws else unexplained(found.best_residuals, after.unit)
        sentence = f"None of the known effects explains the gap{near}."
    else:
        others = [(one.family, one.title) for one in effects if one.name in doubtful and one.name not in best.effects]
        sentence = cause(laws, others, left_over(share, after.location) if verdict == "partly" else "")
        certain = [one for one in effects if one.name in best.effects and one.name not in doubtful]
        # with other tests of its stages the same model would do
        parts = [(one.title, one.of_rig) for one in certain if one.family != CALIBRATION_ERROR]
        sentence += contradicted(contradicting, len(laws))
        whole = verdict != "partly" and not doubtful and len(parts) == len(certain)
        sentence += rig_and_model(parts, all_of_it=whole)
    families = _named_families(found.models, effects, weights)
    return Conclusion(verdict, sentence, effects, families, equal, share, tuple(weights))


def replaced_by_term(conclusion: Conclusion) -> Conclusion:
    """`unknown` in place of a main cause that a term shows to be none, see `Conclusion.replaceable_by`."""
    best = conclusion.indistinguishable[0].effects
    nearest_ones, others = (
        [one.title for one in conclusion.effects if (one.name in best) == chosen] for chosen in (True, False)
    )
    sentence = f"None of the known effects explains the gap{replaced(nearest_ones, others)}."
    return replace(conclusion, verdict="unknown", sentence=sentence)


def _left(
    found: Attribution, before: ResidualMap, after: ResidualMap, settings: DiagnosisSettings
) -> tuple[float, float]:
    """What the best model leaves: relative to the output's peak in the worst test, and as a share of the gap."""
    p_value = settings.gap_p_value
    first, last = found.baseline_residuals.squares(p_value), found.best_residuals.squares(p_value)
    total, still = max(sum(before.squares.values()), first.sum()), max(sum(after.squares.values()), last.sum())
    share = float(np.clip(still / total, 0.0, 1.0)) if total > 0 else 0.0
    peaks = np.array(list(after.peaks.values()))
    of_peak = np.sqrt(np.maximum(np.maximum(list(after.squares.values()), last), 0.0)) / peaks
    return float(of_peak.max()), share


def _named_effects(
    models: Sequence[CandidateModel], equal: Sequence[CandidateModel], weights: FloatArray
) -> tuple[NamedEffect, ...]:
    """The effects of the indistinguishable models, each as in the best model that has it."""
    found = []
    for name in dict.fromkeys(name for one in equal for name in one.effects):
        holder = next(one for one in equal if name in one.effects)
        probability = sum(w for w, one in zip(weights, models, strict=True) if name in one.effects)
        found.append(_named(holder, name, float(probability)))
    # beside 1, probabilities differ by less than their digits hold
    without = {
        effect.family: sum(w for w, one in zip(weights, models, strict=True) if effect.family not in one.families)
        for effect in found
    }
    return in_order(found, doubtful_effects([sorted(one.families) for one in equal]), without)


def in_order(
    effects: Sequence[NamedEffect], doubtful: Collection[str], without: Mapping[str, float]
) -> tuple[NamedEffect, ...]:
    """Families beyond doubt first: what the model lacks, then what the rig adds or the stages told wrongly.

    Then those that are ``doubtful``.

    Of equals the most probable family first, and of a family the most probable effect; ``without`` are the
    probabilities that there is none of a family.
    """

    def place(one: NamedEffect) -> tuple[bool, bool, float, float]:
        unsure, lacked = one.family in doubtful, not one.of_rig and one.family != CALIBRATION_ERROR
        return unsure, not (lacked or unsure), without[one.family], -one.probability

    return tuple(sorted(effects, key=place))


def _named_families(
    models: Sequence[CandidateModel], effects: Sequence[NamedEffect], weights: FloatArray
) -> tuple[NamedFamily, ...]:
    found = [
        NamedFamily(name, float(sum(w for w, one in zip(weights, models, strict=True) if name in one.families)))
        for name in dict.fromkeys(effect.family for effect in effects)
    ]
    # of families that are sure alike, the order of their effects counts
    return tuple(sorted(found, key=lambda family: -round(family.probability, 6)))


def _named(model: CandidateModel, name: str, probability: float) -> NamedEffect:
    """One effect of a model with its size."""
    fitted = model.fitted
    one = next(one for one in fitted.hypothesis.discrepancies if one.name == name)
    size, sd = size_of(fitted, one.effect)
    return NamedEffect(
        name=name,
        title=one.effect.title or name,
        family=one.effect.cause,
        probability=probability,
        size=size,
        size_low=size - _Z90 * sd,
        size_high=size + _Z90 * sd,
        unit=fitted.hypothesis.layout.parameters[one.effect.size[0]].unit,
        parameters=parameters_of(fitted, one.effect),
        present_in_calibration=one.present_in_calibration,
        of_rig=one.effect.of_rig,
    )
