"""The search for terms: those that predict what they were not fitted to, each round around the last joint fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted, fit
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.inner_signals import Target, Variable, inner_signals
from mofit.diagnosis.integration import MOST_STEPS
from mofit.diagnosis.refit import is_reliable
from mofit.diagnosis.term_selection import MOST_TERMS, Columns, Selection, fewest, prediction_errors, selections
from mofit.diagnosis.terms import TermEffect, block, hysteresis_terms, memory_terms, proposed, static_terms
from mofit.errors import InputError

#: Most sets of terms that are fitted jointly in a round, and most of them on one quantity.
_MOST_FITS, _MOST_OF_TARGET = 6, 4


@dataclass(frozen=True)
class Trial:
    """Terms fitted jointly with the parameters, and the squares left of every fold that was left out."""

    fitted: Fitted
    effect: TermEffect | None
    errors: FloatArray

    @property
    def terms(self) -> int:
        """Number of its terms."""
        return len(self.effect.terms) if self.effect else 0

    @property
    def parts(self) -> int:
        """Number of its effects and terms."""
        return self.terms + sum(one is not self.effect for one in self.fitted.hypothesis.effects)

    @property
    def error(self) -> float:
        """Squares left of all folds."""
        return float(self.errors.sum())


def searched(start: Fitted, least: float) -> Trial:
    """Terms added while they predict better what they were not fitted to, each round around the last joint fit.

    A term must remove at least ``least`` squares.
    """
    best = Trial(start, None, prediction_errors(start))
    signals = inner_signals(start)
    targets, variables = signals.targets(), signals.variables()
    while best.terms < MOST_TERMS:
        columns = [_columns(best, target, variables) for target in targets]
        most = MOST_TERMS - best.terms
        tried = [
            trial
            for one in _promising([selections(best.fitted, own, least, most) for own in columns])
            if (trial := _fitted(start, best, one)) is not None
        ]
        if not tried:
            break
        chosen = simplest([best, *tried], least)
        if chosen is best or chosen.effect is None:
            break
        best, targets = chosen, [chosen.effect.target]
    return best


def simplest(trials: Sequence[Trial], least: float) -> Trial:
    """The one with the fewest parts that predicts about as well as the best."""
    by_parts: dict[int, Trial] = {}
    for one in sorted(trials, key=lambda one: one.error):
        by_parts.setdefault(one.parts, one)
    ranked = [by_parts[number] for number in sorted(by_parts)]
    return ranked[fewest(np.array([one.errors for one in ranked]), least)]


def _columns(best: Trial, target: Target, variables: Sequence[Variable]) -> Columns:
    """What every term would add to the outputs, beside those that are there."""
    model = best.fitted.hypothesis
    # the terms act in the dynamic tests: the stages stay as they are
    alone = replace(best.fitted, hypothesis=replace(model, observed=replace(model.observed, calibrations=())))
    records = [w for _, _, w in model.observed.records]
    shortest = 2 * min(w.step for w in records)
    longest = 0.5 * float(np.median([w.step * w.count for w in records]))
    terms, rows = [], []
    for own in (static_terms(variables), *memory_terms(variables, shortest, longest), *hysteresis_terms(variables)):
        found = prepare(alone, block(target, own), model.effects)
        terms += own
        rows.append(found.sensitivities[0][: len(model.observed.measured)])
    return Columns(target, tuple(terms), np.concatenate(rows, axis=1))


def _promising(found: Sequence[Sequence[Selection]]) -> list[Selection]:
    """The best sets of all quantities, not too many of one."""
    few = [one for own in found for one in own[:_MOST_OF_TARGET]]
    return sorted(few, key=lambda one: one.error)[:_MOST_FITS]


def _fitted(start: Fitted, best: Trial, added: Selection) -> Trial | None:
    """The terms so far and those added, fitted jointly with all parameters; None where that fails."""
    old = best.fitted.hypothesis
    present = estimated(best.effect, best.fitted).terms if best.effect else ()
    terms, sizes = [one.term for one in present], [one.value for one in present]
    taken = {*start.hypothesis.layout.names, *(one.name for one in start.hypothesis.effects)}
    effect = proposed(added.target, [*terms, *added.terms], [*sizes, *added.sizes], taken)
    model = hypothesis(
        old.observed, (*start.hypothesis.discrepancies, _discrepancy(effect, len(old.observed.problem.space)))
    )
    count = len(start.minimum.point)
    shift = np.zeros(len(best.fitted.free))
    shift[best.fitted.free] = added.shift
    fresh = model.space.subset([p.name for p in effect.parameters])
    own = fresh.to_unit([p.nominal for p in effect.parameters])
    here = best.fitted.minimum.point[:count]
    starts = np.array([np.concatenate([np.clip(here + part, 0, 1), own]) for part in (shift[:count], 0 * here)])
    try:
        found = fit(model.at_steps_for(starts[:1]), starts)
    except InputError:
        return None
    if found.hypothesis.steps > MOST_STEPS or not is_reliable(found):
        return None
    return Trial(found, effect, prediction_errors(found))


def _discrepancy(effect: TermEffect, free: int) -> Discrepancy:
    point = {p.name: p.nominal for p in effect.parameters if p.neutral is None}
    count = len(effect.size)
    return Discrepancy(effect, point, np.zeros(count), np.zeros(free), np.zeros((free, count)))


def estimated(effect: TermEffect, fitted: Fitted) -> TermEffect:
    """The effect with the estimates as its terms' coefficients and shapes."""
    values = fitted.values
    terms = [
        replace(one, value=values[one.size], term=replace(one.term, point=values.get(one.shape)))
        for one in effect.terms
    ]
    return TermEffect(effect.name, effect.target, terms)
