"""How far the gap shrinks once the effect is added: judged on tests that were left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.several import Attribution
from mofit.diagnosis.steps import bounded
from mofit.refine.step import box_step

Array = NDArray[np.float64]

#: Gauss-Newton steps from the minimum of all tests to that of all but one.
_STEPS = 4
#: Draws of the parameters for the interval.
_DRAWS = 400
#: Chance below which a class of lines holds a gap that is worth counting.
_LOUD = 0.01
#: Standard deviations of the noise's power beyond which the linearised effect leaves a gap.
_CLEAR = 4.0
#: Longest move of a coordinate, in box widths.
_REACH = 0.25


@dataclass(frozen=True)
class HeldOut:
    """What both models say of a test that they were not fitted to.

    ``before`` and ``after`` are predicted outputs without and with the effect over the samples used, (n,); ``start``
    is the first of those.
    """

    test: str
    output: str
    start: int
    before: Array
    after: Array


@dataclass(frozen=True)
class Shrinkage:
    r"""Share of the structured gap that the effect removes on held-out tests.

    .. math:: \eta = 1 - \frac{\sum_t g_{t, \mathrm{with}}^2}{\sum_t g_{t, \mathrm{without}}^2}

    with :math:`g_t^2` the mean square of the prediction's error on test t relative to the output's range, beyond the
    noise; every sample counts alike, however noisy.

    Parameters
    ----------
    predicted
        From the score test alone, before any refit.
    confirmed
        After refits without each test in turn: the predictions beside what all tests together say of that test.
    low, high
        90 % interval of the same.
    measured
        The predictions beside the measured outputs themselves, noise taken off: no model in between, but a weak gap
        drowns in the noise.
    held_out
        The predictions.
    """

    predicted: float
    confirmed: float
    low: float
    high: float
    measured: float
    held_out: tuple[HeldOut, ...]


def shrink(found: Attribution, candidates: Sequence[Candidate], seed: int) -> Shrinkage | None:
    """Leave out one test at a time, fit the rest without and with the best explanation's effects, and compare.

    None if a fit runs away in the test that it has not seen: too stiff for it.
    """
    observed, best = found.baseline.hypothesis.observed, found.best
    rows = len(observed.measured)
    folds = [leave_one_out(fitted) for fitted in (found.baseline, best.fitted)]
    without, with_ = (_held_out_rows(observed, model, points) for model, points in folds)
    if not (bounded(without) and bounded(with_)):
        return None
    loud = {clue.name for clue in found.left.clues if clue.p < _LOUD}
    direct = observed.repeating & observed.of("dc", "odd", "even", "excited", *(loud & {"rotating", "slow"}))
    before, after = mean_squares(observed, np.stack([without, with_], axis=1), direct) - _noise(observed, direct).sum()
    measured = 1 - after / before if before > 0 else 0.0
    full, remainder = best.fitted.residual[:rows], found.best_left.p < _LOUD
    rest = full * np.sqrt(_beyond_noise(observed, full)) if remainder else 0.0
    low, confirmed, high = _interval(best.fitted, with_ - full + rest, without - with_, seed)
    chosen = [next(c for c in candidates if c.name == name) for name in best.effects]
    places = [next(one.best for one in found.screened if one.name == name) for name in best.effects]
    added = [c.slopes[i] for c, i in zip(chosen, places, strict=True)]
    predicted = _predicted(found.baseline, added, remainder)
    return Shrinkage(predicted, confirmed, low, high, min(measured, 1.0), tuple(_predictions(observed, *folds)))


def leave_one_out(fitted: Fitted) -> tuple[Hypothesis, Array]:
    """The hypothesis and its minima without one test each, (tests, d), by Gauss-Newton steps in the box."""
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    tests, rows = len(observed.problem.tests), len(observed.measured)
    points = np.repeat(fitted.minimum.point[None], tests, axis=0)
    kept = np.ones((tests, len(fitted.residual)), dtype=bool)
    kept[:, :rows] = observed.test[None, :] != np.arange(tests)[:, None]
    best, values = points.copy(), np.full(tests, np.inf)
    for _ in range(_STEPS + 1):
        found = model.linear(points)
        residual = np.where(kept, found.residual, 0.0)
        jacobian = found.jacobian * kept[..., None]
        value = 0.5 * np.einsum("km,km->k", residual, residual)
        better = np.nan_to_num(value, nan=np.inf) < values
        best[better], values[better] = points[better], value[better]
        turned = jacobian.transpose(0, 2, 1)
        gradient = np.nan_to_num((turned @ np.nan_to_num(residual)[..., None])[..., 0])
        step, _ = box_step(points, gradient, turned @ jacobian, np.full(tests, 1e-6), _REACH)
        # a step that made things worse is halved towards the best point
        points = np.where(better[:, None], np.clip(points + step, 0.0, 1.0), 0.5 * (points + best))
    # what is too stiff for the test that was left out shows there alone
    return model.at_steps_for(best), best


def _held_out_rows(observed: Observed, model: Hypothesis, points: Array) -> Array:
    """Residual of every row, predicted by the fit that has not seen its test, (m,)."""
    residual = model.linear(points).residual
    return np.asarray(residual[observed.test, np.arange(len(observed.measured))])


def _outputs(observed: Observed, rows: Array, kept: NDArray[np.bool_]) -> list[Array]:
    """Columns of white rows (m, k) as signals (n, k) per part, those rows that are kept.

    Relative to the range of the output and the root of n: sums of squares are relative mean squares.
    """
    found = []
    for i, (_, _, w) in enumerate(observed.parts):
        here = observed.part == i
        columns = np.where(kept[here, None], rows[here], 0.0).T
        signals = np.stack([w.signal(column) for column in columns], axis=1)
        found.append(signals / (observed.ranges[i] * np.sqrt(w.count)))
    return found


def mean_squares(observed: Observed, rows: Array, kept: NDArray[np.bool_]) -> Array:
    """Relative mean square of columns of white rows (m, k), summed over all parts, (k,)."""
    return np.sum([np.sum(signals**2, axis=0) for signals in _outputs(observed, rows, kept)], axis=0)


def _noise(observed: Observed, kept: NDArray[np.bool_]) -> Array:
    """Relative mean square of the noise of every row that is kept, (m,)."""
    return np.asarray(kept * observed.genuine * observed.variance / observed.ranges[observed.part] ** 2)


def _beyond_noise(observed: Observed, residual: Array) -> float:
    """Share of the squares of a residual (m,) that is no noise."""
    square = float(mean_squares(observed, residual[:, None], observed.repeating)[0])
    return max(1 - float(_noise(observed, observed.repeating).sum()) / square, 0.0)


def _interval(fitted: Fitted, error: Array, gain: Array, seed: int) -> list[float]:
    """5 %, 50 % and 95 % of the share over what the parameters may truly be.

    Parameters
    ----------
    fitted
        The explanation, fitted to all tests.
    error
        What it says of each test beyond the prediction made without that test, (m,).
    gain
        By how much the effect moved that prediction, (m,).
    """
    observed, free = fitted.hypothesis.observed, fitted.free
    jacobian = -fitted.jacobian[:, free]
    normal = jacobian.T @ jacobian + np.eye(int(free.sum()))
    root = np.linalg.cholesky(np.linalg.inv(normal))
    moved = np.random.default_rng(seed).standard_normal((_DRAWS, len(root))) @ root.T
    columns = np.column_stack([error, gain, jacobian[: len(error)]])
    products = np.sum([signals.T @ signals for signals in _outputs(observed, columns, observed.repeating)], axis=0)
    one, none = np.ones((_DRAWS, 1)), np.zeros((_DRAWS, 1))
    after, before = (
        np.einsum("di,ij,dj->d", mixed, products, mixed)
        for mixed in (np.hstack([one, none, moved]), np.hstack([one, one, moved]))
    )
    return [float(value) for value in np.quantile(1 - after / before, (0.05, 0.5, 0.95))]


def _predicted(baseline: Fitted, added: Sequence[Array], remainder: bool) -> float:
    """The share that the linearised models remove on each test when fitted to the others.

    What they leave counts only if the explanation is known to leave a ``remainder``: a strong effect bends its own
    direction, and the linear rest of that is none.
    """
    observed, free = baseline.hypothesis.observed, baseline.free
    rows = len(observed.measured)
    model = -baseline.jacobian[:, free]
    both = np.concatenate([model, *added], axis=1)
    signals = _outputs(observed, np.column_stack([baseline.residual[:rows], both[:rows]]), observed.repeating)
    gap, uncertain, left = 0.0, 0.0, 0.0
    for t in range(len(observed.problem.tests)):
        fitted_to = np.ones(len(model), dtype=bool)
        fitted_to[:rows] = observed.test != t
        residual = baseline.residual[fitted_to]
        (alone, _), (shift, spread) = (_solved(columns[fitted_to], residual) for columns in (model, both))
        for (test, _, _), here in zip(observed.parts, signals, strict=True):
            if test == t:
                columns = here[:, 1:]
                gap += float(np.sum((columns @ shift - columns[:, : len(alone)] @ alone) ** 2))
                uncertain += float(np.sum(spread * (columns.T @ columns)))
                left += float(np.sum((here[:, 0] - columns @ shift) ** 2))
    # what is left beyond noise and uncertainty, if that is no chance
    noise = _noise(observed, observed.repeating)
    left -= float(noise.sum()) + uncertain
    uncertain += left if remainder and left > _CLEAR * float(np.sqrt(2 * noise @ noise)) else 0.0
    return 1 - uncertain / (gap + uncertain) if gap > 0 else 0.0


def _solved(columns: Array, residual: Array) -> tuple[Array, Array]:
    """Least-squares solution and its covariance; scaled, as effects have sizes of their own."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / scale
    inverse = np.linalg.inv(scaled.T @ scaled + 1e-12 * np.eye(len(scale))) / np.outer(scale, scale)
    return inverse @ (columns.T @ residual), inverse


def _predictions(
    observed: Observed, before: tuple[Hypothesis, Array], after: tuple[Hypothesis, Array]
) -> Iterator[HeldOut]:
    outputs = [model.simulator.sensitivities(model.full(points)) for model, points in (before, after)]
    for test, output, w in observed.parts:
        series = [stored[test][0][test, w.start : w.start + w.count, output] for stored in outputs]
        name = observed.problem.model.outputs[output].name
        yield HeldOut(observed.problem.tests[test], name, w.start, series[0], series[1])
