"""How far the gap shrinks on records that were kept out of everything, and are predicted once all is done."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isqrt

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.data.signals.smoothing import residual_noise
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hold_out_evidence import covariance_of, power_of
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.input_prediction import with_noise_beside_prediction
from mofit.diagnosis.integration import clipped, stable
from mofit.diagnosis.mean_squares import products_of_tests
from mofit.diagnosis.remainder import Evidence, evidence
from mofit.diagnosis.removed_share import Squares, interval, joined
from mofit.diagnosis.shrinkage import HeldOut, HoldOut, Share
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.models import with_effects
from mofit.problem import build_problem
from mofit.simulation import lacking

#: Draws of the parameters for the interval: 5 % quantiles within 1 % of probability.
_DRAWS = 400
#: Standard deviations of the noise's power beyond which a record shows a gap.
_CLEAR = 4.0


def share_on_records(baseline: Fitted, best: Fitted, records: Campaign, seed: int) -> Share | str:
    """The share of the gap that the effects remove on records that no fit has seen; or why it is not known.

    The squares are those of the errors against the measured outputs, less those of the noise of every record. The
    interval covers the posterior of both fits, with what the best one leaves counted as noise, which records were
    measured, and which blocks of their time (bootstrap).
    """
    observed = baseline.hypothesis.observed
    issues = lacking(with_effects(observed.problem.model, *best.hypothesis.effects), records)
    if issues:
        return f"{issues[0].where}: {issues[0].message}"
    cells = (*baseline.hypothesis.layout.cells, *best.hypothesis.layout.cells)
    if own := dict.fromkeys(name for name, label in cells if label):
        return f"{', '.join(own)} differ from test to test, and no fit has seen those of these records"
    problem = build_problem(
        observed.problem.model, records, space=observed.problem.space, fixed=observed.problem.layout.fixed
    )
    held, random = whiten(problem, (), observed.simulators), np.random.default_rng(seed)
    fits = [_Predicting.of(fitted, held, random) for fitted in (baseline, best)]
    seen, columns = _seen(held, fits)
    hold_outs, exact, drawn, told = [], [], [], []
    for number, name in enumerate(problem.tests):
        before, after = (fit.squares(held, number) for fit in fits)
        away = not stable(np.stack([before, after]))
        after = before if away else after  # nothing is known to be removed
        noise = _noise(held, number, fits[1])
        here, moved = (
            Squares(before[some] - noise, after[some] - noise, np.zeros_like(before[some]))
            for some in (slice(1), slice(1, None))
        )
        samples = sum(w.count for own, _, w in held.records if own == number)
        if here.before.sum() < _CLEAR * noise.sum() * np.sqrt(2 / samples):
            return f"test '{name}' shows no clear gap beyond its noise"
        exact.append(here)
        drawn.append(moved.resampled(random))
        low, high = interval(drawn[-1:], here.share)
        if not away:
            told.append(_evidence(seen, number, columns, best))
        hold_outs.append(HoldOut(name, (name,), here.share, low, high, away, tuple(_series(held, number, fits))))
    share = joined(exact).share
    low, high = interval(drawn, share)
    return Share("records", share, low, high, share, tuple(hold_outs), evidence=tuple(told))


def _seen(held: WhitenedData, fits: Sequence[_Predicting]) -> tuple[WhitenedData, FloatArray]:
    """The records with what past inputs predict of their errors; whitened error, gain and responses (m, 2 + f)."""
    if held.predicted_only.any():
        held = with_noise_beside_prediction(held, fits[1].outputs)
    without, with_ = (
        held.whitened([(one.measured - output)[None, ..., None] for one, output in zip(ones, fit.outputs, strict=True)])
        for ones, fit in ((held.problem.experiments, fit) for fit in fits)
    )
    responses = -held.whitened([slope[None] for slope in fits[1].slopes])[0]
    return held, np.hstack([with_[0], without[0] - with_[0], responses])


def _evidence(held: WhitenedData, test: int, columns: FloatArray, best: Fitted) -> Evidence:
    """Of a record: what past inputs predict of its errors, or what repeats in them."""
    here, covariance = held.test == test, covariance_of(best)
    own = columns * here[:, None]
    # what the fit to all tests leaves is the error itself
    power = power_of(held, [test], np.hstack([own, own[:, :1]]), held.explainable & here, covariance)
    products = products_of_tests(held, own, [test])
    return evidence(power, products[:, 2:, 2:], products[:, 1, 1], covariance, covariance, 0.0)


def _noise(held: WhitenedData, test: int, best: _Predicting) -> FloatArray:
    """Relative mean square of the noise in every block of a record.

    Of a record that does not repeat only what is rough in the error counts, and never more than the error itself: a
    rough output is no noise.
    """
    found = []
    for i, (own, _, w) in enumerate(held.records):
        if own == test:
            error = best.errors[i]
            rough = np.sqrt(np.mean(error**2)) if w.periods else residual_noise(error)[0]
            noise = min(float(rough) / held.ranges[i], float(held.problem.noise.floor[i]))
            found += [noise**2 * len(part) / w.count for part in np.array_split(error, isqrt(w.count))]
    return np.array(found)


@dataclass(frozen=True)
class _Predicting:
    """A fitted model in the records held out.

    Parameters
    ----------
    outputs
        At the estimates, (samples, outputs) per test.
    slopes
        Their derivatives by the free parameters, (samples, outputs, f) per test.
    errors, responses
        Measured minus that over the samples used, (n,) per record, and minus its derivatives by the free parameters.
    moved
        Draws of those about the estimates, the first one there; (1 + draws, f).
    """

    outputs: list[FloatArray]
    slopes: list[FloatArray]
    errors: list[FloatArray]
    responses: list[FloatArray]
    moved: FloatArray

    @classmethod
    def of(cls, fitted: Fitted, held: WhitenedData, random: np.random.Generator) -> _Predicting:
        """From the estimates and their posterior."""
        point, free = fitted.minimum.point[None], fitted.free
        found = hypothesis(held, fitted.hypothesis.discrepancies).at_steps_for(point).outputs(point)
        outputs = [clipped(own[0]) for own, _ in found]
        slopes = [clipped(own[0][..., free] * fitted.derivative[free]) for _, own in found]
        errors, responses = [], []
        for i, (test, output, w) in enumerate(held.records):
            used = slice(w.start, w.start + w.count)
            errors.append(held.used_samples(i) - outputs[test][used, output])
            responses.append(-slopes[test][used, output])
        root = fitted.covariance_root
        moved = random.standard_normal((_DRAWS, len(root))) @ root.T
        return cls(outputs, slopes, errors, responses, np.vstack([np.zeros(len(root)), moved]))

    def squares(self, held: WhitenedData, test: int) -> FloatArray:
        """Relative mean squares per draw and block of time.

        As many blocks as each has samples: errors within a block are alike, and there are many blocks.
        """
        mixed = np.column_stack([np.ones(len(self.moved)), self.moved])
        blocks = []
        for i, (own, _, w) in enumerate(held.records):
            if own == test:
                columns = np.column_stack([self.errors[i], self.responses[i]]) / held.ranges[i]
                parts = np.array_split(columns, isqrt(w.count))
                products = np.stack([part.T @ part for part in parts]) / w.count
                blocks.append(np.einsum("di,bij,dj->db", mixed, products, mixed))
        return np.concatenate(blocks, axis=1)


def _series(held: WhitenedData, test: int, fits: Sequence[_Predicting]) -> Iterator[HeldOut]:
    """Predictions of a record without and with the effects."""
    for own, output, w in held.records:
        if own == test:
            series = [fit.outputs[test][w.start : w.start + w.count, output] for fit in fits]
            yield HeldOut(held.problem.tests[test], held.problem.model.outputs[output].name, w.start, *series)
