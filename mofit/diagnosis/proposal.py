"""Where no known effect explains the gap: terms learnt from the data, fitted jointly, and tried on tests left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.cross_validation import Shrinkage, cross_validate
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted, fit
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.inner_signals import Target, Variable, inner_signals
from mofit.diagnosis.integration import MOST_STEPS
from mofit.diagnosis.model_search import Attribution, with_final_estimates
from mofit.diagnosis.refit import is_reliable, rated
from mofit.diagnosis.residual_map import residual_map
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.term_selection import (
    MOST_TERMS,
    Columns,
    Selection,
    fewest,
    noise_squares,
    prediction_errors,
    selections,
)
from mofit.diagnosis.terms import TermEffect, block, hysteresis_terms, memory_terms, proposed, static_terms
from mofit.diagnosis.whitened_data import WhitenedData, with_discrepancy
from mofit.errors import InputError
from mofit.models import TARGET_UNIT
from mofit.runtime.progress import Progress

#: Standard deviations to the ends of a 90 % interval.
_Z90 = 1.645
#: Most sets of terms that are fitted jointly in a round, and most of them on one quantity.
_MOST_FITS, _MOST_OF_TARGET = 6, 4
#: Standard deviations of the noise by which a test must be predicted worse to count.
_WORSE = 2.0
#: Least number of folds with a gap that a term must halve, if there are so many: one may be predicted by chance.
_FEWEST_FOLDS = 3


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
    beside
        Names of the effects of the main cause that the terms stand beside.
    fitted
        The model with them, its final estimates.
    removed, low, high
        Share of the gap that goes on tests left out, of the model without any effect; 90 % interval.
    observed
        The same against the measured samples themselves.
    held_out
        What was left out: ``tests``, or ``parts`` of them.
    """

    effect: TermEffect
    beside: tuple[str, ...]
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
        return f"{self.effect.title}, added to {self.target.name}"

    @property
    def sentence(self) -> str:
        """What is proposed, and how far it shrinks the gap."""
        beside = f" beside {' and '.join(self.beside)}" if self.beside else ""
        return (
            f"Proposed term{beside}, learnt from these data: {self.law}. On held-out {self.held_out} it removes "
            f"{100 * self.removed:.1f} % of the gap ({100 * self.low:.1f} to {100 * self.high:.1f} %)."
        )

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every parameter of the terms with its interval."""
        space, values = self.fitted.hypothesis.space, self.fitted.values
        sds = dict(zip(space.names, self.fitted.sd() * self.fitted.derivative, strict=True))
        units = {TARGET_UNIT: self.target.unit}
        return tuple(
            Estimate(
                one.name,
                one.description,
                values[one.name],
                values[one.name] - _Z90 * float(sds[one.name]),
                values[one.name] + _Z90 * float(sds[one.name]),
                units.get(one.unit, one.unit),
            )
            for one in self.effect.parameters
        )


@dataclass(frozen=True)
class _Trial:
    """Terms fitted jointly with the parameters, and the squares left of every fold that was left out."""

    fitted: Fitted
    effect: TermEffect | None
    errors: FloatArray

    @property
    def terms(self) -> int:
        return len(self.effect.terms) if self.effect else 0

    @property
    def error(self) -> float:
        return float(self.errors.sum())


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
    noisy = with_discrepancy(
        baseline.hypothesis.observed, rules.resolution * residual_map(baseline).relative, everywhere=True
    )
    starts = [_again(one, noisy) for one in (baseline, main) if one is not None]
    nothing, noise, trials = prediction_errors(starts[0]), noise_squares(noisy), []
    for start in starts:
        progress("proposed term", len(trials), len(starts), " + ".join(one.name for one in start.hypothesis.effects))
        trials.append(_searched(start, rules.residual_share * (nothing - noise).sum()))
    best = min(trials, key=lambda one: one.error)
    if best.effect is None:
        return "no function of the model's inputs and states predicts it in data that were left out"
    removed = 1 - float((best.errors - noise).sum() / (nothing - noise).sum())
    if removed < rules.partly:
        return f"the best term would remove {100 * max(removed, 0.0):.0f} % of it in data that were left out"
    shown = nothing > 2 * noise
    if np.sum(best.errors[shown] < 0.5 * nothing[shown]) < min(_FEWEST_FOLDS, len(nothing)):
        return "what the best term removes lies in one or two tests, which may be chance"
    return _validated(starts[0], best, rules, seed)


def _again(fitted: Fitted, observed: WhitenedData) -> Fitted:
    """The same model fitted to the tests with another noise; the stages stay as they are."""
    here = fitted.minimum.point[None]
    return fit(replace(fitted.hypothesis, observed=observed).at_steps_for(here), here)


def _searched(start: Fitted, least: float) -> _Trial:
    """Terms added while they predict better what they were not fitted to, each round around the last joint fit.

    A term must remove at least ``least`` squares.
    """
    best = _Trial(start, None, prediction_errors(start))
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
        by_number = {number: min((t for t in tried if t.terms == number), key=lambda t: t.error) for number in {t.terms for t in tried}}
        ranked = [best, *(by_number[number] for number in sorted(by_number))]
        chosen = ranked[fewest(np.array([one.errors for one in ranked]), least)]
        if chosen is best or chosen.effect is None:
            break
        best, targets = chosen, [chosen.effect.target]
    return best


def _columns(best: _Trial, target: Target, variables: Sequence[Variable]) -> Columns:
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


def _fitted(start: Fitted, best: _Trial, added: Selection) -> _Trial | None:
    """The terms so far and those added, fitted jointly with all parameters; None where that fails."""
    old = best.fitted.hypothesis
    present = _estimated(best.effect, best.fitted).terms if best.effect else ()
    terms, sizes = [one.term for one in present], [one.value for one in present]
    taken = {*start.hypothesis.layout.names, *(one.name for one in start.hypothesis.effects)}
    effect = proposed(added.target, [*terms, *added.terms], [*sizes, *added.sizes], taken)
    model = hypothesis(old.observed, (*start.hypothesis.discrepancies, _discrepancy(effect, len(old.observed.problem.space))))
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
    return _Trial(found, effect, prediction_errors(found))


def _discrepancy(effect: TermEffect, free: int) -> Discrepancy:
    point = {p.name: p.nominal for p in effect.parameters if p.neutral is None}
    count = len(effect.size)
    return Discrepancy(effect, point, np.zeros(count), np.zeros(free), np.zeros((free, count)))


def _validated(baseline: Fitted, best: _Trial, rules: DiagnosisSettings, seed: int) -> Proposal | str:
    """The proposal with final estimates and its share on tests left out, or why it is refused."""
    observed = baseline.hypothesis.observed
    models = (rated(best.fitted, 1), rated(baseline, 1))
    first, last = residual_tests(baseline), residual_tests(best.fitted)
    found = Attribution(baseline, first, (), models, last)
    remainder = residual_map(best.fitted).relative
    found = with_final_estimates(found, observed, remainder, ())
    fitted = found.best.fitted
    effect = best.effect
    assert effect is not None  # there is one
    estimates = _estimated(effect, fitted)
    beside = tuple(one.name for one in fitted.hypothesis.effects if one.name != effect.name)
    if len(observed.problem.tests) < 2:
        return _of_parts(baseline, best, fitted, estimates, beside)
    shrinkage = cross_validate(found, (), seed)
    if isinstance(shrinkage, str):
        return shrinkage
    if shrinkage.ran_away:
        return f"without {' or '.join(shrinkage.ran_away)} the fit of the best term runs away"
    if shrinkage.refitted < rules.partly or shrinkage.low <= 0:
        return (
            f"the best term removes {100 * shrinkage.refitted:.0f} % of it on held-out tests "
            f"({100 * shrinkage.low:.0f} to {100 * shrinkage.high:.0f} %)"
        )
    if worse := _worse(observed, shrinkage):
        return f"the best term makes {' and '.join(worse)} worse where left out"
    return Proposal(
        estimates, beside, fitted, shrinkage.refitted, shrinkage.low, shrinkage.high, shrinkage.observed, "tests"
    )


def _estimated(effect: TermEffect, fitted: Fitted) -> TermEffect:
    """The effect with the estimates as its terms' coefficients and shapes."""
    values = fitted.values
    terms = [
        replace(one, value=values[one.size], term=replace(one.term, point=values.get(one.shape)))
        for one in effect.terms
    ]
    return TermEffect(effect.name, effect.target, terms)


def _of_parts(
    baseline: Fitted, best: _Trial, fitted: Fitted, effect: TermEffect, beside: tuple[str, ...]
) -> Proposal | str:
    """Of a single test: the share on parts of it that were left out, with its interval over them."""
    noise = noise_squares(baseline.hypothesis.observed)
    before, after = prediction_errors(baseline) - noise, best.errors - noise
    if np.any(after > before):
        return "the best term makes a part of the record worse where left out"
    shares = 1 - after.sum() / before.sum()
    jack = [1 - np.delete(after, k).sum() / np.delete(before, k).sum() for k in range(len(after))]
    sd = float(np.sqrt((len(jack) - 1) * np.var(jack)))
    low, high = shares - _Z90 * sd, min(shares + _Z90 * sd, 1.0)
    if low <= 0:
        return f"the best term removes {100 * shares:.0f} % of it on held-out parts ({100 * low:.0f} to {100 * high:.0f} %)"
    return Proposal(effect, beside, fitted, float(shares), float(low), float(high), float(shares), "parts")


def _worse(observed: WhitenedData, shrinkage: Shrinkage) -> list[str]:
    """Tests that are predicted worse with the terms than without, by more than the noise may do."""
    found = []
    variance = observed.noise_share * observed.variance
    for i, ((test, output, w), held) in enumerate(zip(observed.records, shrinkage.held_out, strict=True)):
        measured = observed.problem.experiments[test].measured[w.start : w.start + w.count, output]
        more = np.sum((measured - held.after) ** 2 - (measured - held.before) ** 2)
        noise = np.sqrt(variance[observed.record == i].sum())
        if more > _WORSE * 2 * noise * np.linalg.norm(held.after - held.before):
            found.append(observed.problem.tests[test])
    return list(dict.fromkeys(found))
