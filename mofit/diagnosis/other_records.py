"""How far the gap shrinks on records that were kept out of everything, and are predicted once all is done."""

from __future__ import annotations

from collections.abc import Iterator
from math import isqrt

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.integration import clipped, stable
from mofit.diagnosis.shrinkage import HeldOut, HoldOut, Share, Squares, interval, joined
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.models import with_effects
from mofit.problem import build_problem
from mofit.simulation import lacking

#: Draws of the parameters for the interval: 5 % quantiles within 1 % of probability.
_DRAWS = 400


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
    problem = build_problem(
        observed.problem.model, records, space=observed.problem.space, fixed=observed.problem.layout.fixed
    )
    held, random = whiten(problem, (), observed.simulators), np.random.default_rng(seed)
    fits = [_Predicting.of(fitted, held, random) for fitted in (baseline, best)]
    at_estimates, hold_outs, drawn = [], [], []
    for number, name in enumerate(problem.tests):
        squares = [fit.squares(held, number) for fit in fits]
        away = not stable(np.stack(squares))
        if away:  # nothing is known to be removed
            squares = [squares[0], squares[0]]
        own = Squares(squares[0][1:], squares[1][1:])
        at_estimates.append(Squares(squares[0][:1], squares[1][:1]))
        drawn.append(own.resampled(random))
        share = at_estimates[-1].share
        low, high = interval(drawn[-1:], share)
        series = tuple(_series(held, number, fits))
        hold_outs.append(HoldOut(name, (name,), share, low, high, away, series))
    share = joined(at_estimates).share
    return Share("records", share, *interval(drawn, share), share, tuple(hold_outs))


class _Predicting:
    """A fitted model in the records held out: outputs, and their errors at draws of the parameters."""

    def __init__(self, model: Hypothesis, outputs: list[FloatArray], responses: list[FloatArray], moved: FloatArray):
        self.model, self.outputs, self._responses, self._moved = model, outputs, responses, moved

    @classmethod
    def of(cls, fitted: Fitted, held: WhitenedData, random: np.random.Generator) -> _Predicting:
        """From the estimates and their posterior."""
        point = fitted.minimum.point[None]
        model = hypothesis(held, fitted.hypothesis.discrepancies).at_steps_for(point)
        found, free = model.outputs(point), fitted.free
        slope = fitted.derivative[free]
        root = np.linalg.cholesky(np.linalg.inv(fitted.hessian))
        moved = random.standard_normal((_DRAWS, len(root))) @ root.T
        return cls(
            model,
            [clipped(outputs[0]) for outputs, _ in found],
            [clipped(slopes[0][..., free] * slope) for _, slopes in found],
            np.vstack([np.zeros(len(root)), moved]),
        )

    def squares(self, held: WhitenedData, test: int) -> FloatArray:
        """Relative mean squares beyond the noise per draw, the first at the estimates, and block of time.

        As many blocks as each has samples: errors within a block are alike, and there are many blocks.
        """
        blocks = []
        for i, (own, output, w) in enumerate(held.records):
            if own != test:
                continue
            used = slice(w.start, w.start + w.count)
            error = held.used_samples(i) - self.outputs[test][used, output]
            columns = np.column_stack([error, -self._responses[test][used, output]]) / held.ranges[i]
            mixed = np.column_stack([np.ones(len(self._moved)), self._moved])
            noise = held.problem.noise.floor[i] ** 2 / w.count
            parts = np.array_split(columns, isqrt(w.count))
            products = np.stack([part.T @ part for part in parts]) / w.count
            found = np.einsum("di,bij,dj->db", mixed, products, mixed)
            blocks.append(found - noise * np.array([len(part) for part in parts]))
        return np.concatenate(blocks, axis=1)


def _series(held: WhitenedData, test: int, fits: list[_Predicting]) -> Iterator[HeldOut]:
    """Predictions of a record without and with the effects."""
    for own, output, w in held.records:
        if own == test:
            series = [fit.outputs[test][w.start : w.start + w.count, output] for fit in fits]
            yield HeldOut(held.problem.tests[test], held.problem.model.outputs[output].name, w.start, *series)
