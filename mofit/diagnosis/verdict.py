"""What is concluded from all that was tried: none, one effect, a group, several, or none of the known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.locate import Where
from mofit.diagnosis.refit import Explanation
from mofit.diagnosis.several import Attribution
from mofit.diagnosis.thresholds import Thresholds

Array = NDArray[np.float64]
Verdict = Literal["none", "effect", "group", "several", "unknown"]

#: Standard deviations to the ends of a 90 % interval.
_Z90 = 1.645
#: Share of the gap from which a remainder is mentioned.
_WORTH_TELLING = 0.02
#: Chance below which it is no longer told how small it is.
_SMALLEST = 1e-16


@dataclass(frozen=True)
class Named:
    """An effect with its probability, and its size with a 90 % interval, in ``unit``.

    Attributes
    ----------
    values
        All of the effect's parameters, fitted.
    everywhere
        Whether the calibration tests seem to have had the effect too.
    """

    name: str
    title: str
    probability: float
    size: float
    size_low: float
    size_high: float
    unit: str
    values: dict[str, float]
    everywhere: bool


@dataclass(frozen=True)
class Conclusion:
    """The verdict and what it rests on.

    Parameters
    ----------
    verdict, sentence
        In a word, and in words.
    effects
        Those named: of the best explanation and of those that are as good, the most probable first.
    alike
        The explanations that the data cannot tell apart, the best first.
    left_share
        Share of the gap's mean square that the best explanation leaves.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[Named, ...]
    alike: tuple[Explanation, ...]
    left_share: float

    @property
    def group(self) -> tuple[str, ...]:
        """Names of the effects that these data cannot tell apart; empty if there is no doubt."""
        sets = [set(explanation.effects) for explanation in self.alike]
        if len(sets) < 2:
            return ()
        doubtful = {name for one in sets for name in one if not all(name in other for other in sets)}
        return tuple(effect.name for effect in self.effects if effect.name in doubtful)


def conclude(
    found: Attribution, before: Where, after: Where, thresholds: Thresholds, told: float | None = None
) -> Conclusion:
    """Draw the conclusion from the gap before and after the best explanation.

    The share that is left decides; ``told`` is said in its place where the fits that are told leave another.
    """
    best = found.best
    limit = best.criterion + (thresholds.alike if len(best.effects) < 2 else thresholds.alike_of_several)
    alike = tuple(
        explanation for explanation in found.explanations if explanation.effects and explanation.criterion < limit
    )
    first, last = found.left.squares(thresholds.left), found.best_left.squares(thresholds.left)
    total, still = max(sum(before.squares.values()), first.sum()), max(sum(after.squares.values()), last.sum())
    share = float(np.clip(still / total, 0.0, 1.0)) if total > 0 else 0.0
    peaks = np.array(list(after.peaks.values()))
    of_peak = np.sqrt(np.maximum(np.maximum(list(after.squares.values()), last), 0.0)) / peaks
    significant = min([found.left.p, *(one.p_holm for one in found.screened)]) < thresholds.gap
    beyond_noise = found.best_left.p < thresholds.left and of_peak.max() > thresholds.left_of_peak
    several = len(best.effects) > 1
    left = beyond_noise and share > (thresholds.left_share_of_several if several else thresholds.left_share)
    share = share if told is None else told
    effects = _named(found.explanations, alike)
    if not significant or (not best.effects and not left):
        return Conclusion("none", "No gap: what the model leaves is noise.", (), (), share)
    titles = [effect.title for effect in effects if effect.name in best.effects]
    if left or not best.effects:
        still_there = f"{100 * share:.0f} % of it" if round(100 * share) else "a pattern of little power"
        nearest = (
            f"; the nearest, {' with '.join(titles)}, leaves {still_there}" if titles else _told(found, after.unit)
        )
        return Conclusion("unknown", f"None of the known effects explains the gap{nearest}.", effects, alike, share)
    doubt = Conclusion("group", "", effects, alike, share).group
    others = [effect.title for effect in effects if effect.name in doubt and effect.name not in best.effects]
    rest = f" {100 * share:.0f} % of its squares are left that no known effect explains."
    caveat = rest if beyond_noise and share > _WORTH_TELLING else ""
    but = f"; these data cannot tell it from {' or '.join(others)}" if others else ""
    if several:
        return Conclusion(
            "several", f"Several effects cause the gap: {' and '.join(titles)}{but}.{caveat}", effects, alike, share
        )
    if others:
        return Conclusion("group", f"The gap is caused by {titles[0]}{but}.{caveat}", effects, alike, share)
    return Conclusion("effect", f"The gap is caused by {titles[0]}.{caveat}", effects, alike, share)


def _told(found: Attribution, unit: str) -> str:
    """What tells a gap that no effect comes near."""
    clue, p = found.best_left.clues[0], found.best_left.p
    chance = f"= {p:.1g}" if p > _SMALLEST else f"< {_SMALLEST:g}"
    return f": {clue.told} ({clue.rms:.2g} {unit} root mean square, p {chance})"


def weights(explanations: Sequence[Explanation]) -> Array:
    """Probability of every explanation among those tried, from the information criterion."""
    criteria = np.array([explanation.criterion for explanation in explanations])
    raw = np.exp(-0.5 * (criteria - criteria.min()))
    return np.asarray(raw / raw.sum())


def _named(explanations: Sequence[Explanation], alike: Sequence[Explanation]) -> tuple[Named, ...]:
    share = weights(explanations)
    names = dict.fromkeys(name for explanation in alike for name in explanation.effects)
    found = []
    for name in names:
        holders = [explanation for explanation in alike if name in explanation.effects]
        probability = sum(w for w, e in zip(share, explanations, strict=True) if name in e.effects)
        found.append(named(holders[0], name, float(probability)))
    return tuple(sorted(found, key=lambda effect: -effect.probability))


def named(explanation: Explanation, name: str, probability: float) -> Named:
    """One effect of an explanation with its size: of several parts, their length."""
    fitted = explanation.fitted
    space = fitted.hypothesis.space
    cause = next(cause for cause in fitted.hypothesis.causes if cause.name == name)
    index = [space.index(part) for part in cause.effect.size]
    values = fitted.values
    away = np.array([values[part] - cause.effect.neutral[part] for part in cause.effect.size])
    spread = (fitted.sd() * space.slope(space.from_unit(fitted.minimum.point)))[index]
    size = float(away[0]) if len(away) == 1 else float(np.linalg.norm(away))
    sd = float(spread[0]) if len(away) == 1 else float(np.linalg.norm(away * spread) / max(size, 1e-300))
    return Named(
        name=name,
        title=cause.effect.title or name,
        probability=probability,
        size=size,
        size_low=size - _Z90 * sd,
        size_high=size + _Z90 * sd,
        unit=space[cause.effect.size[0]].unit,
        values={p.name: values[p.name] for p in cause.effect.parameters},
        everywhere=cause.everywhere,
    )
