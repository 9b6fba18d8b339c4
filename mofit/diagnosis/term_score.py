"""Of simple functions of the model's own signals, added where a term may act, the one that fits a residual best.

What a model lacks is such a function more often than not, though no known effect is like it. And one that acts in a
few moments alone, as a stop at the end of a stroke does, is lost in any sum over lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted, Projection
from mofit.diagnosis.inner_signals import Target, Variable, inner_signals
from mofit.diagnosis.smoothed_motion import fitted_readings
from mofit.diagnosis.term_rows import term_columns
from mofit.diagnosis.term_selection import LEAST_LEFT
from mofit.diagnosis.terms import Term, functions_of

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

    ``projection`` is that of the fit; all is to first order, see `mofit.diagnosis.term_rows`.
    """
    signals = inner_signals(fitted)
    readings = fitted_readings(signals, signals.targets())
    best: tuple[float, Target, Term, FloatArray] | None = None
    tried = 0
    for columns in term_columns(readings, _thinned(signals.variables())):
        usable = columns.usable
        rows = columns.rows[:, usable] / np.linalg.norm(columns.rows[:, usable], axis=0)
        left = projection.apply(rows)
        squares = np.sum(left**2, axis=0)
        fresh = squares > LEAST_LEFT**2
        along = left.T @ projection.residual
        scores = np.where(fresh, along**2 / np.where(fresh, squares, 1.0), 0.0)
        tried += int(fresh.sum())
        k = int(np.argmax(scores)) if len(scores) else 0
        if len(scores) and scores[k] > (best[0] if best else 0.0):
            explained = left[: len(rows), k] * along[k] / squares[k]
            best = float(scores[k]), columns.target, columns.terms[usable[k]], explained
    return TermScore(best[1], best[2], best[0], best[3], tried) if best else None


def _thinned(variables: Sequence[Variable]) -> list[Term]:
    """Functions of one signal, of every form with some of its shapes."""
    forms: dict[tuple[str, str], list[Term]] = {}
    for one in (term for x in variables for term in functions_of(x)):
        forms.setdefault((one.x.name, one.form.text), []).append(one)
    return [one for own in forms.values() for one in own[::_EVERY]]
