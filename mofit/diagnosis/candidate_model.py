"""Candidate models rated by an information criterion, and how probable they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.gap_lines import beyond_noise
from mofit.diagnosis.hypothesis import Hypothesis

#: How much less probable than the plainer law a refinement is before there are data: it needs evidence that is worth
#: more than a bare mention (Kass, Raftery 1995).
_PLAINER = 3.0
#: Least share of the gap that a law leaves: none is right to a thousandth where none is right.
_LEAST_LEFT = 1e-3


@dataclass(frozen=True)
class CandidateModel:
    r"""A fitted hypothesis with its information criterion.

    .. math:: \mathrm{EBIC} = \|r\|^2 + q \log n + 2 \log \binom{c}{k} + 2 m \log 3

    with all whitened squares (prior included) :math:`\|r\|^2`, q parameters of the k effects, n rows that may hold a
    gap, and c candidates: the third term is the price of the selection. Of the effects m refine a plainer law with as
    many parameters (`Effect.refines`). The constants of the records count by Student's t instead of their squares, see
    `doubt_of_constants`.

    Attributes
    ----------
    alternative
        The same effects, the last one present in the calibration tests where here it is not, or the reverse, if that
        was fitted too; its criterion is no smaller.

    References
    ----------
    Chen, Chen: Extended Bayesian information criteria for large model spaces. Biometrika 95 (2008).
    Kass, Raftery: Bayes factors. Journal of the American Statistical Association 90 (1995).
    """

    fitted: Fitted
    criterion: float
    alternative: CandidateModel | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted(effect.name for effect in self.fitted.hypothesis.effects))

    @property
    def families(self) -> frozenset[str]:
        """Families of the effects."""
        return frozenset(effect.cause for effect in self.fitted.hypothesis.effects)


def rated(fitted: Fitted, candidates: int) -> CandidateModel:
    """A fitted hypothesis with its criterion; it was selected among so many candidates."""
    model = fitted.hypothesis
    chosen = len(model.effects)
    choices = gammaln(candidates + 1) - gammaln(chosen + 1) - gammaln(candidates - chosen + 1)
    refinements = sum(bool(effect.refines) for effect in model.effects)
    squares = float(fitted.residual @ fitted.residual) - doubt_of_constants(fitted)
    return CandidateModel(fitted, squares + price(model) + 2 * float(choices + refinements * np.log(_PLAINER)))


def doubt_of_constants(fitted: Fitted) -> float:
    r"""By how much the squares of the records' constants count less, as their noise is not known well.

    .. math:: \sum_s r_s^2 - (\nu + n) \log(1 + \sum_s r_s^2 / \nu)

    of n constants with :math:`\nu` degrees of freedom: a multivariate t distribution. How large their noise is, the
    lines above zero frequency tell of all records alike; no other line is extrapolated.
    """
    observed = fitted.hypothesis.observed
    where = (observed.line == 0) & observed.explainable
    squares, count = float(np.sum(fitted.residual[: len(where)][where] ** 2)), int(where.sum())
    if not count:
        return 0.0
    freedom = count / float(np.sum(1 / observed.degrees_of_freedom[where]))
    return squares - (freedom + count) * float(np.log1p(squares / freedom))


def price(model: Hypothesis) -> float:
    """Of the effects' parameters: the logarithm of the number of rows that each value acts on."""
    layout, observed = model.layout, model.observed
    rows = int(observed.explainable.sum())
    per_test = np.bincount(observed.test[observed.explainable], minlength=len(layout.place))
    on_test = [(layout.place == k).any(axis=1) for k in range(model.own, len(layout.space))]
    acted_on = [rows if tests.all() else int(per_test[tests].sum()) for tests in on_test]
    return float(np.sum(np.log(np.maximum(acted_on, 1))))


def probabilities(models: Sequence[CandidateModel]) -> FloatArray:
    """Probability of every model among these, from the criterion: exp(-EBIC / 2), normalised."""
    criteria = np.array([one.criterion for one in models])
    raw = np.exp(-0.5 * (criteria - criteria.min()))
    return np.asarray(raw / raw.sum())


def probabilities_of_causes(models: Sequence[CandidateModel], baseline: Fitted) -> FloatArray:
    r"""Probability of every model among these where every law misses: :math:`\exp(-C / 2)`, normalised.

    .. math:: C = t \log g^2 + q \log t

    with the share :math:`g^2` of the gap that the model leaves, q parameters of its effects, and t tests. What a model
    leaves counts as noise of unknown level, so no law is certain because another one misses by more than the noise of
    the records. A law misses throughout a test alike: a test is one observation. The model without effects stands for
    the unknown ones.
    """
    tests = len(baseline.hypothesis.observed.problem.tests)
    left = np.array([share_left(one.fitted, baseline) for one in models])
    extra = [sum(len(effect.parameters) for effect in one.fitted.hypothesis.effects) for one in models]
    criteria = tests * np.log(np.maximum(left, _LEAST_LEFT)) + np.array(extra) * np.log(tests)
    raw = np.exp(-0.5 * (criteria - criteria.min()))
    return np.asarray(raw / raw.sum())


def share_left(best: Fitted, baseline: Fitted) -> float:
    """Share of the gap's mean square, beyond the noise, that the best model leaves."""

    def gap(fitted: Fitted) -> float:
        observed = fitted.hypothesis.observed
        told = observed.told(fitted.residual[: len(observed.measured)])
        squares = (told**2 - observed.noise_share * observed.visible) * observed.told_variance
        return float(squares @ beyond_noise(observed, squares))

    left, whole = gap(best), gap(baseline)
    return float(np.clip(left / whole, 0.0, 1.0)) if whole > 0 else 0.0
