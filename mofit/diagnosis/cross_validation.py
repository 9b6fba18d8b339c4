"""How far the gap shrinks once the effect is added, on tests that were left out of the fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hypothesis import Hypothesis, Linear
from mofit.diagnosis.integration import stable
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.nuisances import beside_nuisances, with_own_nuisances
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.optimize import RefineSettings, minimise_each

#: Four Gauss–Newton steps from the minimum of all tests to that of all but one, which is near; the damping keeps flat
#: directions solvable.
_REFIT = RefineSettings(
    max_iterations=4, gradient_tolerance=0.0, decrease_tolerance=0.0, damping=1e-6, least_damping=1e-6
)
#: Draws of the parameters for the interval: 5 % quantiles within 1 % of probability.
_DRAWS = 400
#: p-value below which rotating and slow lines hold a gap that counts on the raw data.
_P_VALUE = 0.01
#: Standard deviations of the noise's power beyond which the linearised effect leaves a gap.
_CLEAR = 4.0


@dataclass(frozen=True)
class HeldOut:
    """Predictions of a test by fits to the others.

    ``before`` and ``after`` are the outputs without and with the effect over the samples used, (n,), from ``start`` on.
    """

    test: str
    output: str
    start: int
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True)
class Shrinkage:
    r"""Share of the gap that the effect removes on held-out tests.

    .. math:: \eta = 1 - \frac{\sum_t g_{t, \mathrm{with}}^2}{\sum_t g_{t, \mathrm{without}}^2}

    with :math:`g_t^2` the mean square of the prediction's error on test t relative to the output's range, beyond the
    noise; every sample counts alike, however noisy.

    Parameters
    ----------
    predicted
        From the score test alone, before any refit.
    refitted
        After refits without each test in turn: the predictions against the fit to all tests.
    low, high
        90 % interval of the same: over the parameters' posterior, and over which tests were measured.
    observed
        The predictions against the measured outputs themselves, noise subtracted: no model in between, but the noise
        hides a small gap.
    held_out
        The predictions.
    ran_away
        Tests without which the fits run away. They do not count in any share but the predicted one.
    """

    predicted: float
    refitted: float
    low: float
    high: float
    observed: float
    held_out: tuple[HeldOut, ...]
    ran_away: tuple[str, ...] = ()

    @property
    def caveat(self) -> str:
        """What to know of the shares; empty if nothing."""
        if not self.ran_away:
            return ""
        return f"{_runs_away(self.ran_away)}. The shares are those of the other tests."


def cross_validate(found: Attribution, candidates: Sequence[Candidate], seed: int) -> Shrinkage | str:
    """Leave out one test at a time, fit the rest without and with the best model's effects, and compare.

    Where hardly a fit holds in the test that it was not fitted to: why there is no share.
    """
    observed, best = found.baseline.hypothesis.observed, found.best
    rows, names = len(observed.measured), observed.problem.tests
    folds = [leave_one_out(fitted) for fitted in (found.baseline, best.fitted)]
    without, with_ = (_held_out_rows(observed, model, points) for model, points in folds)
    diverged = [not stable(np.stack([without, with_])[:, observed.test == t]) for t in range(len(names))]
    without, with_ = (np.where(np.array(diverged)[observed.test], 0.0, errors) for errors in (without, with_))
    full, remainder = best.fitted.residual[:rows], found.best_residuals.p_value < _P_VALUE
    rest = full * np.sqrt(_beyond_noise(observed, full)) if remainder else 0.0
    error, gain = with_ - full + rest, without - with_
    after, before = np.einsum("tii->it", _products(observed, np.stack([error, error + gain], axis=1)))
    kept = ~(diverged | (after - before > before.mean()))
    away = tuple(name for name, holds in zip(names, kept, strict=True) if not holds)
    if kept.sum() < min(2, len(names)) or before[kept].sum() < 0.5 * before.sum():
        return _runs_away(away)
    low, refitted, high = _interval(best.fitted, error, gain, kept, seed)
    significant = {one.name for one in found.baseline_residuals.tests if one.p_value < _P_VALUE}
    direct = observed.explainable & observed.of("dc", "odd", "even", "excited", *(significant & {"rotating", "slow"}))
    direct &= kept[observed.test]
    errors = observed.told(np.stack([without, with_], axis=1))
    still, whole = mean_squares(observed, errors, direct)[::-1] - _noise(observed, direct).sum()
    raw = 1 - still / whole if whole > 0 else 0.0
    rescaled = {one.name: one for one in candidates}
    scores = {one.name: replace(one, candidate=rescaled[one.name]) for one in found.score_tests}
    added = [scores[name].sensitivity for name in best.effects]
    predicted = _predicted(found.baseline, added, remainder)
    return Shrinkage(predicted, refitted, low, high, min(raw, 1.0), tuple(_predictions(observed, *folds)), away)


def _runs_away(tests: Sequence[str]) -> str:
    each = " or ".join(tests)
    return f"without {each} the fit to the other tests runs away: they do not determine the effect"


def leave_one_out(fitted: Fitted) -> tuple[Hypothesis, FloatArray]:
    """The hypothesis and its minima without one test each, (tests, d)."""
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    tests, rows = len(observed.problem.tests), len(observed.measured)
    kept = np.ones((tests, len(fitted.residual)), dtype=bool)
    kept[:, :rows] = observed.test[None, :] != np.arange(tests)[:, None]

    def without(points: FloatArray, test: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        found, used = model.linear(points), kept[test]
        return Linear(np.where(used, found.residual, 0.0), found.jacobian * used[..., None]).normal_equations()

    starts = np.repeat(fitted.minimum.point[None], tests, axis=0)
    points = minimise_each(without, starts, _REFIT).points
    points = with_own_nuisances(model, points, np.arange(tests), _REFIT)
    # what is too stiff for the test that was left out shows there alone
    return model.at_steps_for(points), points


def _held_out_rows(observed: WhitenedData, model: Hypothesis, points: FloatArray) -> FloatArray:
    """Residual of every row, predicted by the fit without its test, (m,)."""
    residual = model.linear(points).residual
    return np.asarray(residual[observed.test, np.arange(len(observed.measured))])


def _signals(observed: WhitenedData, rows: FloatArray, kept: NDArray[np.bool_]) -> list[FloatArray]:
    """Columns of whitened rows (m, k) as signals (n, k) per record, those rows that are kept.

    Relative to the range of the output and the root of n: sums of squares are relative mean squares.
    """
    found = []
    for i, (_, _, w) in enumerate(observed.records):
        here = observed.record == i
        columns = np.where(kept[here, None], rows[here], 0.0).T
        signals = np.stack([w.signal(column) for column in columns], axis=1)
        found.append(signals / (observed.ranges[i] * np.sqrt(w.count)))
    return found


def mean_squares(observed: WhitenedData, rows: FloatArray, kept: NDArray[np.bool_]) -> FloatArray:
    """Relative mean square of columns of whitened rows (m, k), summed over all records, (k,)."""
    return np.sum([np.sum(signals**2, axis=0) for signals in _signals(observed, rows, kept)], axis=0)


def _noise(observed: WhitenedData, kept: NDArray[np.bool_]) -> FloatArray:
    """Relative mean square of the visible noise of every row that is kept, (m,)."""
    share = kept * observed.noise_share * observed.visible
    return np.asarray(share * observed.variance / observed.ranges[observed.record] ** 2)


def _beyond_noise(observed: WhitenedData, residual: FloatArray) -> float:
    """Share of the squares of a residual (m,) that is no noise."""
    square = float(mean_squares(observed, observed.told(residual)[:, None], observed.explainable)[0])
    return max(1 - float(_noise(observed, observed.explainable).sum()) / square, 0.0)


def _products(observed: WhitenedData, columns: FloatArray) -> FloatArray:
    """Relative mean products of columns of whitened rows (m, k) in every test, (tests, k, k)."""
    found = np.zeros((len(observed.problem.tests), columns.shape[1], columns.shape[1]))
    for (test, _, _), signals in zip(observed.records, _signals(observed, columns, observed.explainable), strict=True):
        found[test] += signals.T @ signals
    return found


def _interval(
    fitted: Fitted, error: FloatArray, gain: FloatArray, kept: NDArray[np.bool_], seed: int
) -> tuple[float, float, float]:
    """5 %, 50 % and 95 % quantiles of the share over the posterior of the parameters, the outer ones over tests too.

    From the ``error`` of the predictions without the test against the fit to all, (m,), and their ``gain`` by the
    effect, (m,), in the tests that are ``kept``. Tests are drawn with replacement (bootstrap): where they disagree, one
    test more or less would have given another share.
    """
    random, root = np.random.default_rng(seed), np.linalg.cholesky(np.linalg.inv(fitted.hessian))
    moved = random.standard_normal((_DRAWS, len(root))) @ root.T
    columns = np.column_stack([error, gain, -fitted.jacobian[: len(error), fitted.free]])
    products = _products(fitted.hypothesis.observed, columns)[kept]
    one, none = np.ones((_DRAWS, 1)), np.zeros((_DRAWS, 1))
    after, before = (
        np.einsum("di,tij,dj->dt", mixed, products, mixed)
        for mixed in (np.hstack([one, none, moved]), np.hstack([one, one, moved]))
    )
    middle = float(np.median(1 - after.sum(axis=1) / before.sum(axis=1)))
    times = random.multinomial(len(products), np.full(len(products), 1 / len(products)), _DRAWS)
    low, high = np.quantile(1 - np.sum(times * after, axis=1) / np.sum(times * before, axis=1), (0.05, 0.95))
    return min(float(low), middle), middle, max(float(high), middle)


def _predicted(baseline: Fitted, added: Sequence[FloatArray], remainder: bool) -> float:
    """The share that the linearised models remove on each test when fitted to the others.

    What they leave counts only if the best model is known to leave a ``remainder``: a strong effect bends its own
    direction, and the linear rest of that does not count.
    """
    observed, rows = baseline.hypothesis.observed, len(baseline.hypothesis.observed.measured)
    model, both, residuals = beside_nuisances(baseline, added)
    told = observed.told(np.column_stack([residuals[:rows], both[:rows]]))
    signals = _signals(observed, told, observed.explainable)
    gap, uncertain, left = 0.0, 0.0, 0.0
    for t in range(len(observed.problem.tests)):
        fitted_to = np.ones(len(model), dtype=bool)
        fitted_to[:rows] = observed.test != t
        residual = residuals[fitted_to]
        (alone, _), (shift, covariance) = (_solved(columns[fitted_to], residual) for columns in (model, both))
        for (test, _, _), here in zip(observed.records, signals, strict=True):
            if test == t:
                columns = here[:, 1:]
                gap += float(np.sum((columns @ shift - columns[:, : len(alone)] @ alone) ** 2))
                uncertain += float(np.sum(covariance * (columns.T @ columns)))
                left += float(np.sum((here[:, 0] - columns @ shift) ** 2))
    # what is left beyond noise and uncertainty, if that is no chance
    noise = _noise(observed, observed.explainable)
    left -= float(noise.sum()) + uncertain
    clear = _CLEAR * float(np.sqrt(2 * noise @ noise))
    uncertain += left if remainder and left > clear else 0.0
    return 1 - uncertain / (gap + uncertain) if gap > 0 else 0.0


def _solved(columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares solution and its covariance; scaled, as effects have sizes of their own."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / scale
    inverse = np.linalg.inv(scaled.T @ scaled + 1e-12 * np.eye(len(scale))) / np.outer(scale, scale)
    return inverse @ (columns.T @ residual), inverse


def _predictions(
    observed: WhitenedData, before: tuple[Hypothesis, FloatArray], after: tuple[Hypothesis, FloatArray]
) -> Iterator[HeldOut]:
    outputs = [model.outputs(points) for model, points in (before, after)]
    for test, output, w in observed.records:
        series = [found[test][0][test, w.start : w.start + w.count, output] for found in outputs]
        yield HeldOut(observed.problem.tests[test], observed.problem.model.outputs[output].name, w.start, *series)
