"""Which effects, one or several, explain the gap: a search through refitted explanations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.candidates import Candidate, as_seen_by, moving
from mofit.diagnosis.refit import Explanation, explain, refit
from mofit.diagnosis.remaining import Remaining, remaining
from mofit.diagnosis.screen import Screened, screen
from mofit.diagnosis.thresholds import Thresholds
from mofit.progress import Progress, silent

#: Most candidates that are refitted at once, and most sets of one more effect.
_MOST, _EXTENSIONS = 12, 6
#: Standard deviations by which too much must be left for a second effect not to be looked for; a third is rarer.
_DOUBT = 2.0


@dataclass(frozen=True)
class Attribution:
    """All that was tried.

    Parameters
    ----------
    baseline, left
        The model without effects, and what it leaves.
    screened
        Every candidate at the baseline, the most significant first.
    explanations
        Refitted ones, the best first; the last one is the baseline itself.
    best_left
        What the best explanation leaves.
    """

    baseline: Fitted
    left: Remaining
    screened: tuple[Screened, ...]
    explanations: tuple[Explanation, ...]
    best_left: Remaining

    @property
    def best(self) -> Explanation:
        """The explanation with the smallest criterion."""
        return self.explanations[0]


@dataclass(frozen=True)
class _Search:
    """Explanations found so far."""

    baseline: Fitted
    candidates: Sequence[Candidate]
    thresholds: Thresholds
    found: tuple[Explanation, ...]

    @property
    def best(self) -> Explanation:
        return self.found[0]

    def tried(self, effects: Iterable[str]) -> bool:
        return tuple(sorted(effects)) in {explanation.effects for explanation in self.found}

    def screened_at(self, base: Fitted) -> list[Screened]:
        return screen(base, as_seen_by(base, self.candidates))

    def moved_by(self, base: Fitted) -> set[str]:
        """Names of the candidates that need a condition which an effect of the fitted model moves."""
        return {one.name for one in self.candidates if moving(base, one.effect.needs)}

    def extended(self, base: Fitted, added: Iterable[Screened], progress: Progress) -> _Search:
        """With refits of ``base`` plus each of the added effects."""
        present = [effect.name for effect in base.hypothesis.effects]
        fresh = [one for one in added if not self.tried([*present, one.name])]
        made: dict[str, Explanation] = {}
        lowest = self.best.criterion
        for number, one in enumerate(fresh):
            progress("refit", number, len(fresh), " + ".join([*present, one.name]))
            if (fitted := refit(base, [one], lowest + self.thresholds.contender)) is not None:
                made[one.name] = explain(fitted, len(self.candidates))
                lowest = min(lowest, made[one.name].criterion)
        limit = lowest + self.thresholds.contender
        contenders = [one for one in fresh if one.name in made and made[one.name].criterion < limit]
        # close to the best it matters whether the calibration tests had the effect
        for one in (other for contender in contenders if (other := contender.elsewhere) is not None):
            if (fitted := refit(base, [one], limit)) is not None:
                better, worse = sorted((made[one.name], explain(fitted, len(self.candidates))), key=_order)
                made[one.name] = replace(better, other_way=worse)
        found = tuple(sorted((*self.found, *made.values()), key=_order))
        return _Search(self.baseline, self.candidates, self.thresholds, found)

    def reached(self, effects: Sequence[str], progress: Progress) -> _Search:
        """With a refit of just these effects, added one by one."""
        if self.tried(effects):
            return self
        *first, last = effects
        state = self.reached(first, progress)
        bases = [explanation.fitted for explanation in state.found if explanation.effects == tuple(sorted(first))]
        added = [one for base in bases for one in state.screened_at(base) if one.name == last]
        return state.extended(bases[0], added, progress) if bases else state


def attribute(
    baseline: Fitted, candidates: Sequence[Candidate], thresholds: Thresholds, progress: Progress = silent
) -> Attribution:
    """Search forwards: single effects first, then one more at a time as long as something significant is left.

    An explanation with more effects is kept only where its information criterion is the better one, so that the search
    prunes backwards as well: every part of a set is tried too.
    """
    screened, left = screen(baseline, candidates), remaining(baseline)
    state = _Search(baseline, candidates, thresholds, (explain(baseline, len(candidates)),))
    if min([left.p, *(one.p_holm for one in screened)]) >= thresholds.gap:
        return Attribution(baseline, left, tuple(screened), state.found, left)
    state = state.extended(baseline, _promising(screened, thresholds.promising), progress)
    if remaining(state.best.fitted).p < thresholds.left:
        # a strong effect bends its own direction: what looked hopeless at neutral size may be right
        state = state.extended(baseline, _promising(screened, thresholds.hopeless), progress)
    for count in range(1, thresholds.most_effects):
        # of two effects that cause it, one would have explained more, and of three two, unless one moves the other
        far = _left(state, thresholds.near[count - 1], _DOUBT if count == 1 else 0.0)
        state = _one_more(state, count, progress, only_moved=far)
    return Attribution(baseline, left, tuple(screened), state.found, remaining(state.best.fitted))


def _left(state: _Search, share: float, doubt: float) -> bool:
    """Whether the best explanation leaves more than this share of the baseline's white squares beyond the noise.

    What was gained is well known, the whole only as far as the noise's own squares are: by so many of their standard
    deviations it may be less.
    """
    where = state.baseline.hypothesis.observed.repeating
    noise = where.sum() + doubt * np.sqrt(2 * where.sum())
    left, whole = (
        float(np.sum(fitted.residual[: len(where)][where] ** 2)) for fitted in (state.best.fitted, state.baseline)
    )
    return bool(whole - left < (1 - share) * (whole - noise))


def _one_more(state: _Search, count: int, progress: Progress, only_moved: bool) -> _Search:
    """Extend explanations of ``count`` effects by one more where something is left, those first that promise most.

    Maybe only by what an effect of theirs moves: at a wrong speed a wheel turns with a wrong frequency, and neither
    explains anything alone.
    """
    level = [explanation for explanation in state.found if len(explanation.effects) == count][:_MOST]
    if only_moved:
        level = [explanation for explanation in level if state.moved_by(explanation.fitted)]
    if not level:
        return state
    screened = [state.screened_at(level[0].fitted)]
    if min([remaining(level[0].fitted).p, *(one.p_holm for one in screened[0])]) < state.thresholds.more:
        screened += [state.screened_at(explanation.fitted) for explanation in level[1:]]
        if only_moved:
            moved = [state.moved_by(explanation.fitted) for explanation in level]
            screened = [
                [one for one in tests if one.name in names] for tests, names in zip(screened, moved, strict=True)
            ]
        for base, added in _best_extensions(level, screened, state.thresholds.next_promising):
            state = state.extended(base, added, progress)
    best = state.best.effects
    for left_out in best if len(best) > 1 else ():
        state = state.reached([name for name in best if name != left_out], progress)
    return state


def _best_extensions(
    level: Sequence[Explanation], screened: Sequence[Sequence[Screened]], share: float
) -> list[tuple[Fitted, list[Screened]]]:
    """What to add to which explanation: the sets of which the score test promises the best criteria."""
    promised: dict[tuple[str, ...], tuple[float, Explanation, Screened]] = {}
    for base, tests in zip(level, screened, strict=True):
        for one in tests:
            effects = tuple(sorted((*base.effects, one.name)))
            criterion = base.criterion - one.statistic
            if one.statistic > 0 and criterion < promised.get(effects, (np.inf,))[0]:
                promised[effects] = criterion, base, one
    best = sorted(promised.values(), key=lambda found: found[0])[:_EXTENSIONS]
    worth = level[0].criterion - share * (level[0].criterion - best[0][0]) if best else 0.0
    chosen = [(base, one) for criterion, base, one in best if criterion < worth]
    return [(base.fitted, added) for base in level if (added := [one for by, one in chosen if by is base])]


def _promising(screened: Sequence[Screened], share: float) -> list[Screened]:
    """Those with at least this share of the largest T, the largest first."""
    largest = max((one.statistic for one in screened), default=0.0)
    kept = [one for one in screened if one.statistic > share * largest and one.statistic > 0]
    return sorted(kept, key=lambda one: -one.statistic)[:_MOST]


def _order(explanation: Explanation) -> float:
    return explanation.criterion if np.isfinite(explanation.criterion) else np.inf
