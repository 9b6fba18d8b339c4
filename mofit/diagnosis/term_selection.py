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
    found += [selection(_alone(every[0], k, total), float(singles[k])) for k in forms.values()]
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
    """A step of forward selection.

    The squares left of the held fold with one more column, (K,), and the elimination that leads to the next step:
    every column and the residual beside the parameters and those chosen, ``turned`` (d + K + 1, K + 1), and their
    products in training, ``left``, and on the held fold, ``still``.
    """

    singles: FloatArray
    turned: FloatArray
    left: FloatArray
    still: FloatArray


def _path(train: FloatArray, held: FloatArray, free: int, most: int) -> list[_Step]:
    """Forward selection on products ``train`` of d parameters, K terms and the residual, tested on those ``held``."""
    steps = [_beside_parameters(train, held, free)]
    length = np.diag(train)[free:-1]
    for _ in range(min(most, len(length))):
        last = steps[-1]
        power = np.diag(last.left)[:-1]
        fresh = power > LEAST_LEFT**2 * length
        fresh[list(last.chosen)] = False
        gain = np.where(fresh, last.left[:-1, -1] ** 2 / np.where(fresh, power, 1.0), 0.0)
        if not np.any(gain > 0):
            break
        steps.append(_added(last, int(np.argmax(gain))))
    return [*steps, *[steps[-1]] * (most + 1 - len(steps))]


def _beside_parameters(train: FloatArray, held: FloatArray, free: int) -> _Step:
    """The first step; the last column is the residual."""
    own = -np.linalg.pinv(train[:free, :free], rcond=1e-12, hermitian=True) @ train[:free, free:]
    turned = np.concatenate([own, np.eye(len(train) - free)])
    left = train[free:, free:] + train[free:, :free] @ own
    mixed = held[free:, :free] @ own
    return _step((), turned, left, held[free:, free:] + mixed + mixed.T + own.T @ held[:free, :free] @ own)


def _added(step: _Step, k: int) -> _Step:
    """The step after one more column: all others beside it."""
    share = step.left[k] / step.left[k, k]
    share[k] = 0.0
    chosen = (*step.chosen, k)
    left, still = (_eliminated(products, k, share) for products in (step.left, step.still))
    return _step(chosen, step.turned - np.outer(step.turned[:, k], share), left, still)


def _eliminated(products: FloatArray, k: int, share: FloatArray) -> FloatArray:
    """Products of columns less their shares of column k."""
    mixed = np.outer(products[:, k], share)
    return products - mixed - mixed.T + products[k, k] * np.outer(share, share)


def _alone(first: _Step, k: int, held: FloatArray) -> _Chosen:
    """One column beside the parameters: as the step after it, but without what leads on."""
    last = first.turned[:, -1] - first.turned[:, k] * first.left[k, -1] / first.left[k, k]
    return _Chosen((k,), -last[:-1], float(last @ held @ last))


def _step(chosen: tuple[int, ...], turned: FloatArray, left: FloatArray, still: FloatArray) -> _Step:
    power = np.diag(left)[:-1]
    size = np.where(power > 0, left[:-1, -1] / np.where(power > 0, power, 1.0), 0.0)
    singles = still[-1, -1] - 2 * size * still[:-1, -1] + size**2 * np.diag(still)[:-1]
    return _Step(chosen, -turned[:-1, -1], float(still[-1, -1]), singles, turned, left, still)


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
