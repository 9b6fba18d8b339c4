"""Of simple functions of the model's own signals, added where a term may act, the one that fits a residual best.

What a model lacks is such a function more often than not, though no known effect is like it. And one that acts in a
few moments alone, as a stop at the end of a stroke does, is lost in any sum over lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted, of_few_periods
from mofit.diagnosis.inner_signals import Target, Variable, inner_signals
from mofit.diagnosis.projection import Projection, project
from mofit.diagnosis.smoothed_motion import fitted_readings
from mofit.diagnosis.term_rows import Columns, columns_on, term_signals
from mofit.diagnosis.term_selection import LEAST_LEFT
from mofit.diagnosis.terms import Term, functions_of
from mofit.runtime.parallel import forked_map

#: One of so many shapes of a form is tried: neighbours explain much the same.
_EVERY = 2


@dataclass(frozen=True)
class TermScore:
    r"""The score test of a term: :math:`(c^\top r)^2 / c^\top c` of its rows c beside the parameters.

    Parameters
    ----------
    target, term
        The term, and the quantity that it is added to.
    statistic
        Chi-squared with one degree of freedom without a gap.
    rows
        What the term explains of the residual, (m,).
    tried
        Number of terms, of which this is the best.
    """

    target: Target
    term: Term
    statistic: float
    rows: FloatArray
    tried: int


def best_term(fitted: Fitted, projection: Projection) -> TermScore | None:
    """The function of one signal with the largest score, None if there is none.

    ``projection`` is that of the fit; all is to first order, see `mofit.diagnosis.term_rows`. Where tests repeat, it is
    searched in a few periods, and scored in all.
    """
    brief = of_few_periods(fitted)
    if brief is fitted:
        return _best_term(fitted, projection)
    found = _best_term(brief, project(brief))
    return _best_term(fitted, projection, found) if found else None


def _best_term(fitted: Fitted, projection: Projection, known: TermScore | None = None) -> TermScore | None:
    """The same among all terms, or where one is ``known`` of that alone."""
    signals = inner_signals(fitted)
    targets, terms = ([known.target], [known.term]) if known else (signals.targets(), _thinned(signals.variables()))
    readings, added = fitted_readings(signals, targets), term_signals(signals, terms)
    found = forked_map(
        lambda one: _best_of(columns_on(one, terms, added), projection),
        readings,
        fitted.hypothesis.observed.processes,
        name=lambda one: one.target.name,
    )
    pairs = [(reading.target, one) for reading, one in zip(readings, found, strict=True) if one.statistic > 0]
    if not pairs:
        return None
    target, best = max(pairs, key=lambda pair: pair[1].statistic)
    acting = [term for term in terms if term.acts_on(target)]
    tried = known.tried if known else sum(one.tried for one in found)
    return TermScore(target, acting[best.place], best.statistic, best.rows, tried)


@dataclass(frozen=True)
class _Best:
    """The term with the largest score on a quantity by its place, and how many were tried there."""

    place: int
    statistic: float
    rows: FloatArray
    tried: int


def _best_of(columns: Columns, projection: Projection) -> _Best:
    usable = columns.usable
    if not usable:
        return _Best(0, 0.0, np.empty(0), 0)
    rows = columns.rows[:, usable] / np.linalg.norm(columns.rows[:, usable], axis=0)
    left = projection.apply(rows)
    squares, along = np.sum(left**2, axis=0), left.T @ projection.residual
    fresh = squares > LEAST_LEFT**2
    scores = np.where(fresh, along**2 / np.where(fresh, squares, 1.0), 0.0)
    k = int(np.argmax(scores))
    explained = left[: len(rows), k] * along[k] / squares[k] if fresh[k] else np.empty(0)
    return _Best(usable[k], float(scores[k]), explained, int(fresh.sum()))


def _thinned(variables: Sequence[Variable]) -> list[Term]:
    """Functions of one signal, of every form with some of its shapes."""
    forms: dict[tuple[str, str], list[Term]] = {}
    for one in (term for x in variables for term in functions_of(x)):
        forms.setdefault((one.x.name, one.form.text), []).append(one)
    return [one for own in forms.values() for one in own[::_EVERY]]
