"""Terms fitted jointly with the parameters of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.few_periods import at_steps_for
from mofit.diagnosis.fitting import Fitted, fit
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.inner_signals import Target
from mofit.diagnosis.refit import is_reliable
from mofit.diagnosis.term_selection import Selection, prediction_errors
from mofit.diagnosis.terms import Term, TermEffect, proposed
from mofit.errors import InputError
from mofit.optimize import Minimum
from mofit.runtime.parallel import forked_map

#: Share of its value that a joint fit must gain over some iterations: a fraction of that half a per cent.
_CRAWLING = 1e-3


@dataclass(frozen=True, eq=False)
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
    def placed(self) -> list[tuple[Term, float]]:
        """Its terms with their estimates."""
        placed = estimated(self.effect, self.fitted).terms if self.effect else ()
        return [(one.term, one.value) for one in placed]

    @property
    def parts(self) -> int:
        """Number of its effects and terms."""
        return self.terms + sum(one is not self.effect for one in self.fitted.hypothesis.effects)

    @property
    def error(self) -> float:
        """Squares left of all folds."""
        return float(self.errors.sum())


@dataclass(frozen=True)
class Joint:
    """Terms on a quantity with their coefficients, and points to fit them from jointly with all parameters."""

    target: Target
    terms: tuple[tuple[Term, float], ...]
    points: tuple[FloatArray, ...]

    @classmethod
    def of(cls, selection: Selection, here: FloatArray, present: Sequence[tuple[Term, float]] = ()) -> Joint:
        """What was selected at some parameters, beside terms that are present: from there, and from where it shifts."""
        moved = here.copy()
        moved[selection.free] += selection.shift
        terms = (*present, *zip(selection.terms, selection.sizes, strict=True))
        return cls(selection.target, terms, (moved, here))

    def name(self) -> str:
        """In words."""
        return f"{' + '.join(term.title for term, _ in self.terms)} on {self.target.name}"

    def beside(self, start: Fitted) -> tuple[TermEffect, Hypothesis]:
        """The terms as an effect, and the model with it."""
        old = start.hypothesis
        taken = {*old.layout.names, *(one.name for one in old.effects)}
        effect = proposed(self.target, [term for term, _ in self.terms], [size for _, size in self.terms], taken)
        own = _discrepancy(effect, len(old.observed.problem.space))
        return effect, hypothesis(old.observed, (*old.discrepancies, own))


@dataclass(frozen=True)
class SentTrial:
    """What a process sends of a trial: effects and compiled models do not pickle."""

    joint: Joint
    steps: int
    minimum: Minimum
    residual: FloatArray
    jacobian: FloatArray
    errors: FloatArray

    @classmethod
    def of(cls, one: Trial) -> SentTrial:
        """A trial with terms."""
        assert one.effect is not None
        joint, found = Joint(one.effect.target, tuple((t.term, t.value) for t in one.effect.terms), ()), one.fitted
        return cls(joint, found.hypothesis.steps, found.minimum, found.residual, found.jacobian, one.errors)

    def beside(self, start: Fitted) -> Trial:
        """The trial again."""
        effect, model = self.joint.beside(start)
        return Trial(
            Fitted(model.with_steps(self.steps), self.minimum, self.residual, self.jacobian), effect, self.errors
        )


def fitted_jointly(start: Fitted, wanted: Sequence[Joint]) -> list[Trial]:
    """Joint fits, several at a time; without those that fail."""

    def sent(one: Joint) -> SentTrial | None:
        try:
            effect, model = one.beside(start)
            fresh = model.space.subset([p.name for p in effect.parameters])
            values, count = fresh.to_unit([p.nominal for p in effect.parameters]), len(start.minimum.point)
            starts = [np.concatenate([np.clip(point[:count], 0.0, 1.0), values]) for point in one.points]
            # no worse than without the terms
            fine = at_steps_for(model, starts[0][None], start.hypothesis.steps)
            found = fit(fine, np.array(starts), 2 * start.minimum.value, start, _CRAWLING)
        except InputError:  # also where a quantity would depend on itself, by an effect on what the term reads
            return None
        # a shape at the end of its range is another form
        shapes = [found.hypothesis.space.index(placed.shape) for placed in effect.terms if placed.shape]
        if np.any(found.minimum.at_bound[shapes]) or not is_reliable(found):
            return None
        errors = prediction_errors(found)
        return SentTrial.of(Trial(found, effect, errors)) if np.isfinite(errors.sum()) else None

    found = forked_map(sent, wanted, start.hypothesis.observed.processes, name=Joint.name)
    return [one.beside(start) for one in found if one is not None]


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
