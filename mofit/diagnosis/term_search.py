"""The search for terms: those that predict what they were not fitted to, each round around the last joint fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.inner_signals import Target, Variable, inner_signals
from mofit.diagnosis.smoothed_motion import fitted_readings, readings_without, smoothed_readings
from mofit.diagnosis.term_rows import Reading, term_columns, term_functions
from mofit.diagnosis.term_selection import MOST_TERMS, Selection, fewest, prediction_errors, selections
from mofit.diagnosis.term_trial import Joint, Trial, fitted_jointly
from mofit.diagnosis.terms import Term, hysteresis_terms, memory_terms, static_terms
from mofit.runtime.parallel import forked_map

#: Most sets of terms on a quantity that are fitted jointly in a round: those that predict best, and those that fit
#: best, as a strong term bends its own direction; and most of all.
_PREDICTING, _FITTING, _MOST_FITS = 2, 1, 5
#: Most quantities for which terms with memory are tried: those on which a term without one predicts best.
_QUANTITIES = 3
#: Most numbers in the rows of all terms for memory times other signals to be tried: 24 MB.
_NUMBERS = 3e6
#: Most rounds: a few lead to a term, and one or two add others.
_ROUNDS = 8
#: Share of the least squares to remove up to which fits are equal: half a per cent of the gap.
_EQUAL = 0.25


def searched(start: Fitted, least: float) -> Trial:
    """Terms that predict what they were not fitted to, each round along the motion of the last joint fit.

    Further ones, as long as they predict better, or others instead, as the motion comes nearer to the records. A term
    must remove at least ``least`` squares; what a later one makes superfluous goes again.
    """
    best, own = Trial(start, None, prediction_errors(start)), inner_signals(start, rates=True)
    variables = own.variables()
    # where the records tell little of a state, the fitted motion is the better guess
    fitted = fitted_readings(own, own.targets())
    smoothed = smoothed_readings(fitted)
    targets, others = _likely(start, fitted, smoothed, variables, least)
    further = list[Trial]()
    for readings in (fitted, [one for one in smoothed if one.motion is not own]):
        likely = [one for one in readings if one.target in targets]
        others += _tried(start, best, likely, [], variables, least)
    for _ in range(_ROUNDS):
        chosen = simplest([best, *others, *further], least)
        if chosen is best or chosen.effect is None:
            break
        again, best, own = chosen in others, chosen, inner_signals(chosen.fitted, rates=True)
        (moved,) = smoothed_readings(fitted_readings(own, [chosen.effect.target]))
        without = readings_without(own, moved, best.placed, targets) if again else []
        others = _tried(start, best, without, [], variables, least)
        further = _tried(start, best, [moved], best.placed, variables, least) if best.terms < MOST_TERMS else []
    return _pruned(start, best, least)


def _tried(
    start: Fitted,
    best: Trial,
    readings: Sequence[Reading],
    present: Sequence[tuple[Term, float]],
    variables: Sequence[Variable],
    least: float,
) -> list[Trial]:
    """Promising terms fitted jointly with those that are present, from the parameters of the best trial so far."""
    terms = _terms(best, variables)
    promising = _promising(_selected(start, readings, terms, least, MOST_TERMS - len(present)))
    # of equals the first counts: the first quantity, and the shortest text
    order = [one.target for one in readings]
    promising.sort(key=lambda one: (order.index(one.target), sum(term.form.length for term in one.terms)))
    return fitted_jointly(start, [Joint.of(one, best.fitted.minimum.point, present) for one in promising])


def _selected(
    start: Fitted, readings: Sequence[Reading], terms: Sequence[Term], least: float, most: int
) -> list[list[Selection]]:
    """Of every reading the sets of terms that predict, several readings at a time."""

    def selected(reading: Reading) -> list[Selection]:
        (columns,) = term_columns([reading], terms)
        return selections(start.hypothesis.observed, columns, least, most)

    term_functions(tuple(terms))  # once, not by every process
    processes = start.hypothesis.observed.processes
    return forked_map(selected, readings, processes, name=lambda one: one.target.name)


def _likely(
    start: Fitted,
    fitted: Sequence[Reading],
    smoothed: Sequence[Reading],
    variables: Sequence[Variable],
    least: float,
) -> tuple[list[Target], list[Trial]]:
    """The quantities on which a term without memory predicts best, in their order: those with memory are dear.

    To first order terms on many of them do about the same. So the best one of each is fitted jointly.
    """
    targets = [one.target for one in fitted]
    if len(targets) <= _QUANTITIES:
        return targets, []
    selected = _selected(start, [*fitted, *smoothed], static_terms(variables), least, 1)
    singles: dict[str, Selection] = {}
    for one in sorted((one for own in selected for one in own), key=lambda one: one.error):
        singles.setdefault(one.target.name, one)
    trials = fitted_jointly(start, [Joint.of(one, start.minimum.point) for one in singles.values()])
    best = [one.effect.target.name for one in sorted(trials, key=lambda one: one.error) if one.effect]
    kept = list(dict.fromkeys([*best, *singles]))[:_QUANTITIES]
    return [one for one in targets if one.name in kept], trials


def _pruned(start: Fitted, best: Trial, least: float) -> Trial:
    """Without the terms that it does not need."""
    while best.effect is not None and best.terms > 1:
        every, here = best.placed, (best.fitted.minimum.point,)
        fewer = [Joint(best.effect.target, (*every[:k], *every[k + 1 :]), here) for k in range(len(every))]
        chosen = simplest([best, *fitted_jointly(start, fewer)], least)
        if chosen is best:
            break
        best = chosen
    return best


def in_all_periods(start: Fitted, best: Trial) -> Trial:
    """Terms that were found where a few periods of every test count, fitted where all do; none if they cannot be."""
    if best.effect is None or best.fitted.hypothesis.observed is start.hypothesis.observed:
        return best
    here = best.fitted.minimum.point[: len(start.minimum.point)]
    again = fitted_jointly(start, [Joint(best.effect.target, tuple(best.placed), (here,))])
    return again[0] if again else Trial(start, None, prediction_errors(start))


def simplest(trials: Sequence[Trial], least: float) -> Trial:
    """The one with the fewest parts that predicts about as well as the best; of equals the first."""
    by_parts: dict[int, list[Trial]] = {}
    for one in trials:
        by_parts.setdefault(one.parts, []).append(one)
    ranked = []
    for _, own in sorted(by_parts.items()):
        limit = min(one.error for one in own) + _EQUAL * least
        ranked.append(next(one for one in own if one.error <= limit))
    return ranked[fewest(np.array([one.errors for one in ranked]), least)]


def _terms(best: Trial, variables: Sequence[Variable]) -> list[Term]:
    """Terms without memory, and with one over times and lengths from samples to the record."""
    records = [w for _, _, w in best.fitted.hypothesis.observed.records]
    shortest = 2 * min(w.step for w in records)
    longest = 0.5 * float(np.median([w.step * w.count for w in records]))
    # the memory of a rate is what the signal itself has changed within it
    read = [one for one in variables if not one.derivative_of]
    groups = [static_terms(variables), *memory_terms(read, shortest, longest), *hysteresis_terms(read)]
    terms = [one for own in groups for one in own]
    if len(terms) * len(best.fitted.residual) <= _NUMBERS:
        return terms
    return [one for one in terms if one.y in (None, one.x) or not one.form.drives]


def _promising(found: Sequence[Sequence[Selection]]) -> list[Selection]:
    """The best sets of all quantities, not too many of one, the best without memory among them."""
    few: list[Selection] = []
    for own in found:
        predicting = list(own[:_PREDICTING])
        static = next((one for one in own if not any(term.form.drives for term in one.terms)), None)
        predicting += [static] if static is not None and static not in predicting else []
        fitting = sorted((one for one in own if one not in predicting), key=lambda one: one.left)
        few += predicting + fitting[:_FITTING]
    return sorted(few, key=lambda one: one.error)[:_MOST_FITS]
