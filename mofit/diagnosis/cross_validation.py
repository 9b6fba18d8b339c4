"""How far the gap shrinks on tests of the campaign that were left out of the fit: each in turn, and whole groups."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.groups import Group, groups
from mofit.diagnosis.hold_out_evidence import evidence_of
from mofit.diagnosis.hypothesis import Linear
from mofit.diagnosis.integration import stable
from mofit.diagnosis.left_out import REFIT, REFIT_OF_GROUPS, leave_out
from mofit.diagnosis.mean_squares import mean_squares, noise_squares, products_of_tests
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.predicted_shrinkage import predicted_share
from mofit.diagnosis.predictive_density import deviance
from mofit.diagnosis.projection import project
from mofit.diagnosis.remainder import Evidence
from mofit.diagnosis.removed_share import Squares, interval, joined
from mofit.diagnosis.shrinkage import HeldOut, HoldOut, Kind, Share, Shrinkage
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.optimize import RefineSettings
from mofit.runtime.parallel import forked_map

#: Hold-outs that are fitted together, by a process: few enough to share the work, and enough to simulate side by side.
_TOGETHER = 4
#: Draws of the parameters for the interval: 5 % quantiles within 1 % of probability.
_DRAWS = 400
#: p-value below which rotating and slow lines hold a gap that counts on the raw data.
_P_VALUE = 0.01


def cross_validate(found: Attribution, candidates: Sequence[Candidate], seed: int) -> Shrinkage:
    """Leave out one test at a time, and whole groups; fit the rest without and with the best model's effects; compare.

    There is no share of a kind of hold-out where hardly a fit holds in the tests that it was not fitted to.
    """
    observed = found.baseline.hypothesis.observed
    if len(observed.problem.tests) < 2:
        return Shrinkage(())
    reference = _Reference.of(found, seed)
    single = [Group(name, (number,)) for number, name in enumerate(observed.problem.tests)]
    together = groups(observed, found.best.fitted.hypothesis.effects)
    kinds: dict[Kind, list[_Predicted]] = {
        "test": list(_predicted(found, reference, single, REFIT)),
        "group": list(_predicted(found, reference, together, REFIT_OF_GROUPS)),
    }
    limit = float(np.mean([one.squares.before[0].sum() for one in kinds["test"]]))
    judged = {kind: [one.judged(limit) for one in predicted] for kind, predicted in kinds.items()}
    away = [one.hold_out for predicted in judged.values() for one in predicted if one.hold_out.ran_away]
    once = {one.tests: one for one in reversed(away)}  # a test may be a group by itself
    shares = [share for kind, predicted in judged.items() if (share := _share(kind, predicted, seed))]
    rescaled = {one.name: one for one in candidates}
    scores = {one.name: replace(one, candidate=rescaled[one.name]) for one in found.score_tests}
    added = [scores[name].sensitivity for name in found.best.effects if name in scores]
    predicted = predicted_share(found.baseline, added, reference.remainder)
    return Shrinkage(tuple(shares), predicted, tuple(reversed(once.values())))


@dataclass(frozen=True)
class _Reference:
    """What predictions are compared with: the fit to all tests and what it leaves.

    Parameters
    ----------
    remainder
        Whether the best model is known to leave something.
    full, rows
        The residual of the fit to all tests, and that of the reference, (m,).
    moved
        Draws of the free parameters about their estimates, the first one there; (1 + draws, f).
    hidden
        Mean square per test that the best model may leave hidden by the noise, for every draw, (1 + draws, tests).
    direct
        Rows that the measured share counts, (m,).
    """

    remainder: bool
    full: FloatArray
    rows: FloatArray
    moved: FloatArray
    hidden: FloatArray
    direct: NDArray[np.bool_]
    seed: int

    @classmethod
    def of(cls, found: Attribution, seed: int) -> _Reference:
        best, observed = found.best.fitted, found.baseline.hypothesis.observed
        full, remainder = best.residual[: len(observed.measured)], found.best_residuals.p_value < _P_VALUE
        noise, squares = _noise_of_tests(observed, full, observed.explainable)
        beyond = 1 - noise / np.maximum(squares, np.finfo(float).tiny)
        rest = full * np.sqrt(beyond)[observed.test] if remainder else 0.0
        root, random = best.covariance_root, np.random.default_rng(seed)
        moved = random.standard_normal((_DRAWS, len(root))) @ root.T
        significant = {one.name for one in found.baseline_residuals.tests if one.p_value < _P_VALUE}
        direct = observed.of("dc", "odd", "even", "excited", *(significant & {"rotating", "slow"}))
        direct &= observed.explainable
        hidden = np.zeros((1 + _DRAWS, len(noise))) if remainder else _hidden(best, direct, random)
        return cls(remainder, full, full - rest, np.vstack([np.zeros(len(root)), moved]), hidden, direct, seed)


@dataclass(frozen=True)
class _Predicted:
    """A hold-out with the squares of its predictions' errors.

    Parameters
    ----------
    squares
        Against the reference, at every draw of the parameters, the first one at their estimates.
    observed
        Against the measured outputs beyond the noise, without and with the effect.
    evidence
        What it tells of new records.
    """

    hold_out: HoldOut
    squares: Squares
    observed: FloatArray
    evidence: Evidence

    def judged(self, limit: float) -> _Predicted:
        """The same, nothing being removed where the fit runs away: worse by more than the limit per test."""
        before, after = self.squares.before, self.squares.after
        worse = after[0].sum() - before[0].sum() > limit * before.shape[1]
        if not (worse or self.hold_out.ran_away):
            return self
        away = replace(self.hold_out, share=0.0, low=0.0, high=0.0, ran_away=True, gain=0.0)
        return replace(self, hold_out=away, squares=Squares(before, before, np.zeros_like(before)))


def _share(kind: Kind, predicted: Sequence[_Predicted], seed: int) -> Share | None:
    """The share on hold-outs of one kind, if there are any and most of the gap lies where fits hold."""
    held = [one for one in predicted if not one.hold_out.ran_away]
    gaps = [sum(float(one.squares.before[0].sum()) for one in some) for some in (held, predicted)]
    fewest = min(2, len(predicted)) if kind == "test" else 1
    if len(held) < fewest or gaps[0] < 0.5 * gaps[1]:
        return None
    whole, holding = ([one.squares for one in some] for some in (predicted, held))
    middle, random = joined(whole).share, np.random.default_rng(seed)
    if kind == "test":  # the share on tests like these; a group stands for another one
        whole, holding = [joined(whole)], [joined(holding)]
    low, _ = interval([one.resampled(random) for one in whole], middle)
    _, high = interval([one.resampled(random) for one in holding], middle)
    before, after = np.sum([one.observed for one in held], axis=0)
    raw = 1 - after / before if before > 0 else 0.0
    hold_outs, told = tuple(one.hold_out for one in predicted), tuple(one.evidence for one in held)
    return Share(kind, middle, low, high, min(float(raw), 1.0), hold_outs, told)


def _predicted(
    found: Attribution, reference: _Reference, left_out: Sequence[Group], settings: RefineSettings
) -> Iterator[_Predicted]:
    """Predictions without and with the effect, by fits without each of these."""
    if not left_out:
        return
    baseline, best = found.baseline, found.best.fitted
    observed, rows = baseline.hypothesis.observed, len(reference.rows)

    def folds(fold: tuple[Fitted, Sequence[Group]]) -> tuple[Linear, list[FloatArray]]:
        model, points = leave_out(fold[0], [one.tests for one in fold[1]], settings)
        return model.linear(points), [test for test, _ in model.outputs(points)]

    parts = [left_out[first : first + _TOGETHER] for first in range(0, len(left_out), _TOGETHER)]
    wanted = [(fitted, part) for fitted in (best, baseline) for part in parts]
    found_of = forked_map(folds, wanted, observed.processes, name=lambda fold: fold[1][0].name)
    each = [_joined(found_of[len(parts) :]), _joined(found_of[: len(parts)])]
    linear, outputs = zip(*each, strict=True)
    response = -best.jacobian[:rows, best.free]
    for k, group in enumerate(left_out):
        here = np.isin(observed.test, group.tests)
        errors = np.where(here[:, None], np.stack([one.residual[k, :rows] for one in linear], axis=1), 0.0)
        diverged = not stable(errors)
        if diverged:  # nothing is known to be removed of the gap that the fit to all tests shows
            errors = np.column_stack(2 * [baseline.residual[:rows] * here])
        without, with_ = errors.T
        columns = np.column_stack([with_ - reference.rows * here, without - with_, response * here[:, None]])
        products = products_of_tests(observed, columns, group.tests)
        squares = _squares(products, reference.moved, reference.hidden[:, list(group.tests)])
        direct = reference.direct & here
        alone = _only(observed, group.tests)
        noise, _ = _noise_of_tests(alone, reference.full, direct, group.tests)
        beyond = mean_squares(alone, alone.told(errors), direct) - noise.sum()
        share = squares.share
        low, high = interval([squares.resampled(np.random.default_rng(reference.seed))], share)
        names = tuple(observed.problem.tests[number] for number in group.tests)
        series = tuple(_series(observed, group.tests, [[test[k] for test in side] for side in outputs]))
        told = evidence_of(best, alone, group.tests, errors, direct)
        gain = 0.0 if diverged else _gain((baseline, best), linear, k, group.tests)
        one = HoldOut(group.name, names, share, low, high, diverged, series, gain, group.later)
        yield _Predicted(one, squares, beyond, told)


def _joined(parts: Sequence[tuple[Linear, list[FloatArray]]]) -> tuple[Linear, list[FloatArray]]:
    """Rows and outputs per test of all hold-outs together."""
    residual, jacobian = (np.concatenate([getattr(one, key) for one, _ in parts]) for key in ("residual", "jacobian"))
    return Linear(residual, jacobian), [np.concatenate(test) for test in zip(*(own for _, own in parts), strict=True)]


def _gain(fits: Sequence[Fitted], without: Sequence[Linear], number: int, tests: Sequence[int]) -> float:
    """By how much the deviance of these tests falls from the first fit to the second, both without them.

    0 where derivatives diverge: then nothing is known of it.
    """
    if not all(stable(one.jacobian[number]) for one in without):
        return 0.0
    first, second = (
        deviance(fitted, tests, one.residual[number], one.jacobian[number])
        for fitted, one in zip(fits, without, strict=True)
    )
    return first - second


def _only(observed: WhitenedData, tests: Sequence[int]) -> WhitenedData:
    """The same, but what past inputs predict is sought in some tests alone."""
    pairs = zip(observed.records, observed.predictors, strict=False)
    return replace(observed, predictors=tuple(own if test in tests else None for (test, _, _), own in pairs))


def _squares(products: FloatArray, moved: FloatArray, hidden: FloatArray) -> Squares:
    """Mean squares at draws (n, f) from products (tests, 2 + f, 2 + f) of error, gain and response."""
    one, none = np.ones((len(moved), 1)), np.zeros((len(moved), 1))
    after, before = (
        np.einsum("di,tij,dj->dt", mixed, products, mixed)
        for mixed in (np.hstack([one, none, moved]), np.hstack([one, one, moved]))
    )
    return Squares(before, after, hidden)


def _hidden(best: Fitted, kept: NDArray[np.bool_], random: np.random.Generator) -> FloatArray:
    """Draws of what the best model leaves in the rows kept of every test, relative mean square, its estimate first.

    Where nothing significant is left: the squares beyond the noise, as uncertain as the noise's power and its estimate.
    """
    observed, rows = best.hypothesis.observed, len(kept)
    tests = len(observed.problem.tests)
    noise = noise_squares(observed, kept) * (1 - project(best).leverage[:rows])
    squares = _noise_of_tests(observed, best.residual[:rows], kept)[1]
    power, squared, weighted = (
        np.bincount(observed.test, one, tests) for one in (noise, noise**2, noise * observed.degrees_of_freedom)
    )
    freedom = np.maximum(weighted / np.maximum(power, np.finfo(float).tiny), 1.0)
    sd = np.sqrt(2 * squared + 2 * power**2 / freedom)
    estimate = squares - power
    return np.vstack([estimate, estimate + sd * random.standard_normal((_DRAWS, tests))])


def _noise_of_tests(
    observed: WhitenedData, residual: FloatArray, kept: NDArray[np.bool_], tests: Sequence[int] = ()
) -> FloatArray:
    """Relative mean square of the noise in the rows kept of tests (all), and of a residual (m,) there; (2, tests).

    The noise is no more than the residual: what repeats differently from the excitation, as a ramp, looks like noise.
    """
    tests = tests or range(len(observed.problem.tests))
    told = (observed.told(np.where(kept, residual, 0.0)) * kept)[:, None]
    squares = products_of_tests(observed, told, tests)[:, 0, 0]
    noise = np.bincount(observed.test, noise_squares(observed, kept), len(observed.problem.tests))[list(tests)]
    return np.stack([np.minimum(noise, squares), squares])


def _series(observed: WhitenedData, tests: Sequence[int], outputs: Sequence[Sequence[FloatArray]]) -> Iterator[HeldOut]:
    """Predictions of some tests from the outputs (samples, outputs) of all, without and with the effect."""
    for test, output, w in observed.records:
        if test in tests:
            series = [side[test][w.start : w.start + w.count, output] for side in outputs]
            yield HeldOut(observed.problem.tests[test], observed.problem.model.outputs[output].name, w.start, *series)
