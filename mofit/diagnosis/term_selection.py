"""Which of many terms a gap needs: orthogonal forward selection, its length by cross-validation.

Linear in the coefficients: every term is a column, what it adds to the outputs per unit of its coefficient at the
fitted model. A fit to tests, or to blocks of them, follows from sums of products of columns over each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.inner_signals import Target
from mofit.diagnosis.mean_squares import record_signals
from mofit.diagnosis.term_rows import Columns, Linearisation
from mofit.diagnosis.terms import Term
from mofit.diagnosis.whitened_data import WhitenedData

#: Most terms of a proposal.
MOST_TERMS = 3
#: A single test is left out in so many blocks; one more, the first, is always fitted: it holds the initial state.
_BLOCKS = 5
#: Share of fits to the other folds in an estimate of prediction errors.
_EFRON = 0.632
#: Share of its length that must be left of a column beside the parameters' and those chosen.
LEAST_LEFT = 1e-3


@dataclass(frozen=True, eq=False)
class Selection:
    """Terms for a quantity with their coefficients, and by how much they shift the parameters that are ``free``.

    ``error`` are the squares that a selection on other folds leaves of a fold, over all of them; ``left`` those that a
    fit to all leaves.
    """

    target: Target
    terms: tuple[Term, ...]
    sizes: FloatArray
    shift: FloatArray
    free: NDArray[np.bool_]
    error: float
    left: float


def selections(observed: WhitenedData, columns: Columns, least: float, most: int = MOST_TERMS) -> list[Selection]:
    """Sets of terms by how well they predict folds which they were not fitted to.

    The one that forward selection leads to, as few terms as predict within one standard error of the best number, or
    within ``least`` squares; and every form alone, at the best of its shapes. The best first.
    """
    beside, rows = columns.beside, len(observed.measured)
    usable = columns.usable
    size = np.linalg.norm(columns.rows[:, usable], axis=0)
    own = [beside.slopes[:rows], columns.rows[:, usable] / size, beside.residual[:rows, None]]
    grams, total = fold_products(observed, np.concatenate(own, axis=1))
    total, free = total + _prior(observed, beside, len(total)), int(beside.free.sum())
    paths = [_path(total - gram, gram, free, most) for gram in grams]
    errors = np.array([[step.error for step in path] for path in paths]).T
    number = fewest(errors, least)
    every = _path(total, total, free, most)

    def selection(step: _Chosen, error: float) -> Selection:
        return Selection(
            columns.target,
            tuple(columns.terms[usable[k]] for k in step.chosen),
            np.array([step.solution[free + k] / size[k] for k in step.chosen]),
            step.solution[:free],
            beside.free,
            error,
            step.error,
        )

    found = [selection(every[number], float(errors[number].sum()))] if number else []
    singles = np.sum([path[0].singles for path in paths], axis=0)
    forms: dict[str, int] = {}
    for k in np.argsort(singles, kind="stable"):
        forms.setdefault(columns.terms[usable[k]].title, int(k))
    beside_parameters = _Products(total, _shares(total, free))
    found += [selection(_alone(total, beside_parameters, k), float(singles[k])) for k in forms.values()]
    return sorted(found, key=lambda one: one.error)


def prediction_errors(fitted: Fitted) -> FloatArray:
    """Squares that a prediction leaves of every fold, (folds,): Efron's .632 estimate.

    0.368 of what the fit to all leaves, which is optimistic, and 0.632 of what fits to the other folds leave, by one
    Gauss-Newton step from the fit to all, which is pessimistic for a fold that holds most of what there is to learn.
    Efron, "Estimating the error rate of a prediction rule", 1983.
    """
    observed, beside = fitted.hypothesis.observed, Linearisation.of(fitted)
    rows = len(observed.measured)
    grams, total = fold_products(observed, np.column_stack([beside.slopes[:rows], beside.residual[:rows]]))
    total = total + _prior(observed, beside, len(total))
    free = int(fitted.free.sum())
    without = np.array([_path(total - gram, gram, free, 0)[0].error for gram in grams])
    return _EFRON * without + (1 - _EFRON) * grams[:, -1, -1]


def fewest(errors: FloatArray, least: float) -> int:
    """Fewest terms within one standard error of the best number, or within ``least``; of errors (terms + 1, folds)."""
    best = int(np.argmin(errors.sum(axis=1)))
    for number in range(best):
        worse = errors[number] - errors[best]
        if worse.sum() <= max(np.sqrt(len(worse)) * worse.std(ddof=1), least):
            return number
    return best


@dataclass(frozen=True)
class _Chosen:
    """Columns chosen, the least-squares solution (d + K,) with them, and the squares left of the held fold."""

    chosen: tuple[int, ...]
    solution: FloatArray
    error: float


@dataclass(frozen=True)
class _Step(_Chosen):
    """A step of forward selection: also the squares left of the held fold with one more column, (K,)."""

    singles: FloatArray


class _Products:
    """Products of columns, each less its share of the parameters' columns and of those chosen: what is asked for alone.

    ``own`` (d, K + 1) are the shares of the parameters' columns, ``products`` (d + K + 1, d + K + 1) all products. Of
    all pairs of columns few are needed: every column with itself and with the last one, and the chosen ones' rows.
    """

    def __init__(self, products: FloatArray, own: FloatArray) -> None:
        d = len(own)
        self._inner, self._mixed, self.own = products[d:, d:], products[d:, :d], own
        self._turned = products[:d, :d] @ own
        #: Columns taken out of all others, their products with all, and the shares of them.
        self.eliminated = list[tuple[int, FloatArray, FloatArray]]()
        mixed = np.einsum("ai,ia->a", self._mixed, own)
        self.power = np.diag(self._inner) + 2 * mixed + np.sum(own * self._turned, axis=0)
        self.last = self._first_row(-1)

    def _first_row(self, k: int) -> FloatArray:
        one = self.own[:, k]
        return self._inner[k] + self._mixed @ one + self._mixed[k] @ self.own + one @ self._turned

    def row(self, k: int) -> FloatArray:
        """Products of column k with all, (K + 1,)."""
        found = self._first_row(k)
        for j, known, share in self.eliminated:
            found = found - found[j] * share - share[k] * known + known[j] * share[k] * share
        return found

    def without(self, k: int, share: FloatArray) -> None:
        """From now on every column less its share of column k."""
        row = self.row(k)
        self.power = self.power - 2 * row * share + row[k] * share**2
        self.last = self.last - row * share[-1] - share * row[-1] + row[k] * share * share[-1]
        self.eliminated.append((k, row, share))


def _path(train: FloatArray, held: FloatArray, free: int, most: int) -> list[_Step]:
    """Forward selection on products ``train`` of d parameters, K terms and the residual, tested on those ``held``."""
    own = _shares(train, free)
    left, still = _Products(train, own), _Products(held, own)
    chosen, turned = list[tuple[int, FloatArray]](), _turned(own, -1)
    steps = [_step((), turned, left, still)]
    length = np.diag(train)[free:-1]
    for _ in range(min(most, len(length))):
        power = left.power[:-1]
        fresh = power > LEAST_LEFT**2 * length
        fresh[[k for k, _ in chosen]] = False
        gain = np.where(fresh, left.last[:-1] ** 2 / np.where(fresh, power, 1.0), 0.0)
        if not np.any(gain > 0):
            break
        k = int(np.argmax(gain))
        share = left.row(k) / left.power[k]
        share[k] = 0.0
        column = _turned(own, k)
        for (_, before), (_, _, old) in zip(chosen, left.eliminated, strict=True):
            column = column - old[k] * before
        turned = turned - share[-1] * column
        left.without(k, share)
        still.without(k, share)
        chosen.append((k, column))
        steps.append(_step(tuple(one for one, _ in chosen), turned, left, still))
    return [*steps, *[steps[-1]] * (most + 1 - len(steps))]


def _shares(products: FloatArray, free: int) -> FloatArray:
    """Minus the least-squares coefficients of the d parameters for every other column, (d, K + 1)."""
    return np.asarray(-np.linalg.pinv(products[:free, :free], rcond=1e-12, hermitian=True) @ products[:free, free:])


def _turned(own: FloatArray, k: int) -> FloatArray:
    """A column less its share of the parameters' columns, as coefficients of all columns, (d + K + 1,)."""
    unit = np.zeros(own.shape[1])
    unit[k] = 1.0
    return np.concatenate([own[:, k], unit])


def _alone(train: FloatArray, left: _Products, k: int) -> _Chosen:
    """One column beside the parameters, and the squares that it leaves in training; ``left`` is of no step."""
    last = _turned(left.own, -1) - _turned(left.own, k) * left.last[k] / left.power[k]
    return _Chosen((k,), -last[:-1], float(last @ train @ last))


def _step(chosen: tuple[int, ...], turned: FloatArray, left: _Products, still: _Products) -> _Step:
    power = left.power[:-1]
    size = np.where(power > 0, left.last[:-1] / np.where(power > 0, power, 1.0), 0.0)
    singles = still.last[-1] - 2 * size * still.last[:-1] + size**2 * still.power[:-1]
    return _Step(chosen, -turned[:-1], float(still.last[-1]), singles)


def fold_products(observed: WhitenedData, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Products of columns of whitened rows (m, k) over every fold, (folds, k, k), and over all rows, (k, k).

    As signals relative to the output's range, every sample alike: sums of squares are relative mean squares. A fold is
    a test, or a block of a single one.
    """
    tests = len(observed.problem.tests)
    blocks = 1 if tests > 1 else _BLOCKS + 1
    found = np.zeros((tests * blocks, columns.shape[1], columns.shape[1]))
    signals_of_records = record_signals(observed, columns, observed.explainable)
    for (test, _, _), signals in zip(observed.records, signals_of_records, strict=True):
        for block, part in enumerate(np.array_split(signals, blocks)):
            found[test * blocks + block] += part.T @ part
    return found if tests > 1 else found[1:], found.sum(axis=0)


def noise_of_folds(observed: WhitenedData) -> FloatArray:
    """Squares of the noise in the metric of `fold_products`, (folds,)."""
    share = observed.explainable * observed.noise_share * observed.variance
    tests = len(observed.problem.tests)
    relative = share / observed.ranges[observed.record] ** 2
    found = np.array([relative[observed.test == test].sum() for test in range(tests)])
    return found if tests > 1 else np.full(_BLOCKS, found[0] / (_BLOCKS + 1))


def _prior(observed: WhitenedData, beside: Linearisation, size: int) -> FloatArray:
    """Products of the rows of prior and box of the free parameters, in the metric of `fold_products`."""
    rows = len(observed.measured)
    slopes, residual = beside.slopes[rows:], beside.residual[rows:]
    below = np.column_stack([slopes, np.zeros((len(slopes), size - 1 - slopes.shape[1])), residual])
    found = below.T @ below
    place = np.arange(slopes.shape[1])
    found[place, place] += 1.0
    # a whitened row has variance 1, one of the metric has this
    kept = observed.explainable
    return np.asarray(found * np.mean(observed.variance[kept] / observed.ranges[observed.record[kept]] ** 2))
