"""The conclusion from all that was tried: none, one effect, a group, several, or none of the known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.refit import CandidateModel, probabilities
from mofit.diagnosis.residual_map import ResidualMap
from mofit.diagnosis.residual_tests import Residuals
from mofit.diagnosis.settings import DiagnosisSettings

Verdict = Literal["none", "effect", "group", "several", "unknown"]

#: Standard deviations to the ends of a 90 % interval.
_Z90 = 1.645
#: p-value below which only the bound is printed.
_SMALLEST = 1e-16


@dataclass(frozen=True)
class NamedEffect:
    """An effect with its probability, its size with a 90 % interval in ``unit``, and all its fitted ``parameters``.

    ``present_in_calibration``: whether it seems to have been present in the calibration tests too.
    """

    name: str
    title: str
    probability: float
    size: float
    size_low: float
    size_high: float
    unit: str
    parameters: dict[str, float]
    present_in_calibration: bool


@dataclass(frozen=True)
class Conclusion:
    """The verdict, and a sentence for people.

    Parameters
    ----------
    effects
        Those of the indistinguishable models, the most probable first.
    indistinguishable
        The models with effects that the data cannot distinguish from the best, the best first.
    residual_share
        Share of the gap's mean square that the best model leaves.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[NamedEffect, ...]
    indistinguishable: tuple[CandidateModel, ...]
    residual_share: float

    @property
    def group(self) -> tuple[str, ...]:
        """Names of the effects that these data cannot distinguish; empty if there is no doubt."""
        doubtful = doubtful_effects([one.effects for one in self.indistinguishable])
        return tuple(effect.name for effect in self.effects if effect.name in doubtful)


def doubtful_effects(sets: Sequence[Sequence[str]]) -> set[str]:
    """Effects that are in some of several sets, but not in all."""
    return {name for one in sets for name in one if not all(name in other for other in sets)}


@dataclass(frozen=True)
class Finding:
    """What the verdict depends on.

    Parameters
    ----------
    effects
        Names of the effects of the best model.
    significant
        Whether there is a gap.
    left_p_value, left_of_peak, left_share
        What the best model leaves: the p-value of its residual tests, its root mean square relative to the output's
        peak in the worst test, its share of the gap's mean square.
    doubtful
        Whether other models are indistinguishable from the best.
    """

    effects: Sequence[str]
    significant: bool
    left_p_value: float
    left_of_peak: float
    left_share: float
    doubtful: bool = False

    def beyond_noise(self, settings: DiagnosisSettings) -> bool:
        """Whether what is left is significant, and large enough to matter."""
        enough = self.left_of_peak > settings.residual_of_peak
        return self.left_p_value < settings.residual_p_value and enough

    def verdict(self, settings: DiagnosisSettings) -> Verdict:
        """The verdict."""
        several = len(self.effects) > 1
        limit = settings.residual_share_of_several if several else settings.residual_share
        unexplained = self.beyond_noise(settings) and self.left_share > limit
        if not self.significant or not (self.effects or unexplained):
            return "none"
        if unexplained or not self.effects:
            return "unknown"
        return "several" if several else "group" if self.doubtful else "effect"


def conclude(
    found: Attribution,
    before: ResidualMap,
    after: ResidualMap,
    settings: DiagnosisSettings,
    reported_share: float | None = None,
) -> Conclusion:
    """Draw the conclusion from the gap before and after the best model.

    ``reported_share`` replaces the share that is left in the sentence, where the final estimates leave another than
    the one that the verdict rests on.
    """
    best, residual = found.best, settings.residual_p_value
    several = len(best.effects) > 1
    limit = best.criterion + (settings.indistinguishable_of_several if several else settings.indistinguishable)
    equal = tuple(one for one in found.models if one.effects and one.criterion < limit)
    first, last = found.baseline_residuals.squares(residual), found.best_residuals.squares(residual)
    total, still = max(sum(before.squares.values()), first.sum()), max(sum(after.squares.values()), last.sum())
    share = float(np.clip(still / total, 0.0, 1.0)) if total > 0 else 0.0
    peaks = np.array(list(after.peaks.values()))
    of_peak = np.sqrt(np.maximum(np.maximum(list(after.squares.values()), last), 0.0)) / peaks
    doubtful = doubtful_effects([one.effects for one in equal])
    finding = Finding(
        effects=best.effects,
        significant=found.p_value < settings.gap_p_value,
        left_p_value=found.best_residuals.p_value,
        left_of_peak=float(of_peak.max()),
        left_share=share,
        doubtful=bool(doubtful),
    )
    share = share if reported_share is None else reported_share
    verdict = finding.verdict(settings)
    if verdict == "none":
        return Conclusion("none", "No gap: the residual is noise.", (), (), share)
    effects = _named_effects(found.models, equal)
    titles = {effect.name: effect.title for effect in effects}
    named = [titles[name] for name in titles if name in best.effects]
    if verdict == "unknown":
        near = nearest(named, share) if named else unexplained(found.best_residuals, after.unit)
        return Conclusion("unknown", f"None of the known effects explains the gap{near}.", effects, equal, share)
    others = [titles[name] for name in titles if name in doubtful and name not in best.effects]
    rest = share if finding.beyond_noise(settings) and share > settings.reported_share else 0.0
    return Conclusion(verdict, cause(named, others, rest), effects, equal, share)


def nearest(titles: Sequence[str], share: float) -> str:
    """How much the best model leaves of a gap that it does not explain."""
    percent, doubt = (f"{100 * share:.0f}", "") if round(100 * share) else ("less than 0.5", ", which is significant")
    return f". The nearest, {' with '.join(titles)}, leaves {percent} % of the gap's mean square{doubt}"


def unexplained(residuals: Residuals, unit: str) -> str:
    """The most significant residual test of a gap that no effect comes near."""
    test, p = residuals.tests[0], residuals.p_value
    bound = f"= {p:.1g}" if p > _SMALLEST else f"< {_SMALLEST:g}"
    return f": {test.description} ({test.rms:.2g} {unit} root mean square, p {bound})"


def cause(titles: Sequence[str], others: Sequence[str], rest: float) -> str:
    """What causes the gap, what else may, and the share that is left."""
    several = len(titles) > 1
    start = f"Several effects cause the gap: {' and '.join(titles)}." if several else f"{titles[0]} causes the gap."
    named = "them" if several else "it"
    doubt = f" These data cannot distinguish {named} from {' or '.join(others)}." if others else ""
    caveat = f" No known effect explains {100 * rest:.0f} % of the gap's mean square." if rest else ""
    return f"{start[0].upper()}{start[1:]}{doubt}{caveat}"


def _named_effects(models: Sequence[CandidateModel], equal: Sequence[CandidateModel]) -> tuple[NamedEffect, ...]:
    """The effects of the indistinguishable models, each as in the best model that has it."""
    share = probabilities(models)
    found = []
    for name in dict.fromkeys(name for one in equal for name in one.effects):
        holder = next(one for one in equal if name in one.effects)
        probability = sum(w for w, one in zip(share, models, strict=True) if name in one.effects)
        found.append(_named(holder, name, float(probability)))
    return tuple(sorted(found, key=lambda effect: -effect.probability))


def _named(model: CandidateModel, name: str, probability: float) -> NamedEffect:
    """One effect of a model with its size: of several components, their length."""
    fitted, values = model.fitted, model.fitted.values
    space = fitted.hypothesis.space
    one = next(one for one in fitted.hypothesis.discrepancies if one.name == name)
    away = np.array([values[part] - one.effect.neutral[part] for part in one.effect.size])
    sds = (fitted.sd() * fitted.derivative)[[space.index(part) for part in one.effect.size]]
    size, sd = float(away[0]), float(sds[0])
    if len(away) > 1:
        size = float(np.linalg.norm(away))
        sd = float(np.linalg.norm(away * sds) / max(size, 1e-300))
    return NamedEffect(
        name=name,
        title=one.effect.title or name,
        probability=probability,
        size=size,
        size_low=size - _Z90 * sd,
        size_high=size + _Z90 * sd,
        unit=space[one.effect.size[0]].unit,
        parameters={p.name: values[p.name] for p in one.effect.parameters},
        present_in_calibration=one.present_in_calibration,
    )
