"""What an effect leaves of the gap on a new record, as a share of it: the interval that holds what is then measured.

The share left is the estimation error of the parameters, plus what the law misses. Both are positive and differ by
decades, so all is done with their logarithms. The estimation error is known from the posterior. What the law misses is
known from the tests left out only as far as it stands out from the noise: the law may be exact, or miss anything from
the estimation error to the whole gap, every decade being as probable. Records differ in both: the spread between tests
is a random effect, which a new record has anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mofit._typing import FloatArray

#: Shares that a law may miss: 0, and a grid of their logarithms, 23 per decade.
_LOGS = np.linspace(np.log(1e-7), np.log(30.0), 196)
_SHARES = np.concatenate([[0.0], np.exp(_LOGS)])
#: Standard deviations of the logarithm between records. Beforehand they are half-normal: what a law misses differs by
#: factors of about e.
_SPREADS = np.linspace(0.05, 2.5, 16)
_TYPICAL_SPREAD = 1.0
#: Probability beforehand that the law is exact, and levels of what it misses else.
_EXACT, _LEVELS = 0.5, 40
#: Draws for the interval: its ends are 5 % quantiles within 0.5 % of probability.
_DRAWS = 2000
_TINY = float(np.finfo(float).tiny)
#: Estimation errors are no smaller share of the gap than this.
_LEAST = 1e-12


@dataclass(frozen=True)
class Power:
    """Mean square of an error, and what it is expected to be made of beside what the law misses.

    Parameters
    ----------
    error, gap
        Mean square of the error with the effect, and of the difference that the effect makes.
    noise, noise_squared, noise_freedom
        Expected mean square of the noise, the sum of its squares over all lines, and the degrees of freedom of its
        estimate.
    estimation, estimation_squared
        Expected mean square of the estimation error, and half its variance.
    """

    error: float
    gap: float
    noise: float
    noise_squared: float
    noise_freedom: float
    estimation: float
    estimation_squared: float

    def log_likelihood(self) -> FloatArray:
        """Of every share that the law may miss, (shares,).

        The logarithm of the power has the tails of a t distribution, since the noise is estimated.
        """
        missed = _SHARES * self.gap
        expected = np.maximum(self.noise + self.estimation + missed, _TINY)
        per_line = self.noise_squared / max(self.noise, _TINY)
        noise = 2 * self.noise_squared + 2 * self.noise**2 / self.noise_freedom
        variance = noise + 2 * self.estimation_squared + 4 * (missed + self.estimation) * per_line
        relative = np.maximum(variance / expected**2, _TINY)
        distance = np.log(max(self.error, _TINY) / expected) ** 2 / relative
        tail = 0.5 * (self.noise_freedom + 1) * np.log1p(distance / self.noise_freedom)
        return np.asarray(-0.5 * np.log(relative) - tail)


@dataclass(frozen=True)
class Evidence:
    """What a hold-out tells of the share that is left.

    Parameters
    ----------
    power
        Of its error.
    whole, without
        Expected estimation error as a share of the gap, per test: of the fit to all tests, and of that without these.
    parts
        Relative weights of the squares of independent normal variables that the estimation error consists of.
    moved, expected
        Mean square by which the prediction moves when these are left out, and what the posterior expects of that.
    """

    power: Power
    whole: FloatArray
    without: FloatArray
    parts: FloatArray
    moved: float
    expected: float

    @cached_property
    def log_likelihood(self) -> FloatArray:
        """Of every share that the law may miss, (shares,), the largest being 0."""
        found = self.power.log_likelihood()
        return np.asarray(found - found.max())


def evidence(
    power: Power,
    responses: FloatArray,
    gaps: FloatArray,
    whole: FloatArray,
    without: FloatArray,
    moved: float,
) -> Evidence:
    """From products of the responses (tests, f, f), gaps per test (tests,) and covariances of two fits (f, f)."""
    gaps = np.maximum(gaps, _TINY)
    some, others = (np.einsum("ij,tji->t", one, responses) for one in (whole, without))
    # the eigenvalues of a product of two covariances are those of a symmetric matrix
    parts = np.maximum(np.linalg.eigvals(whole @ responses.sum(axis=0)).real, 0.0)
    shares = [np.maximum(one / gaps, _LEAST) for one in (some, others)]
    relative = parts / max(parts.sum(), _TINY)
    return Evidence(power, shares[0], shares[1], relative, moved, float((others - some).sum()))


def left_on_new_records(
    hold_outs: Sequence[Evidence], tests: Sequence[Evidence], random: np.random.Generator, *, alike: bool = False
) -> FloatArray:
    """Draws of the share left on a new record like those held out.

    Parameters
    ----------
    hold_outs
        Of one kind; a new record is as probably like any of them.
    tests
        Tests left out in turn: they tell how records differ. May be empty.
    alike
        Whether those held out are records of one kind: their estimation errors differ by chance alone. Tests differ by
        plan, in amplitude and frequency, and so will new ones.
    """
    missed = _missed(hold_outs, _spread_between(tests), random)
    return missed + _estimation(hold_outs, tests, random, alike)


def _estimation(
    hold_outs: Sequence[Evidence], tests: Sequence[Evidence], random: np.random.Generator, alike: bool
) -> FloatArray:
    """Draws of the estimation error, of the fit to all tests or the one without some: both stand for new records."""
    level = np.array([[np.mean(np.log(one.whole)), np.mean(np.log(one.without))] for one in hold_outs])
    which, fit = random.integers(len(hold_outs), size=_DRAWS), random.integers(2, size=_DRAWS)
    found = np.exp(level[which, fit] if alike else level.mean(axis=0)[fit])
    for k, one in enumerate(hold_outs):
        here = which == k
        found[here] *= random.chisquare(1, (int(here.sum()), len(one.parts))) @ one.parts
    if not alike:
        apart = _between(tests, sum(len(one.whole) for one in hold_outs), random)
        with np.errstate(over="ignore"):  # two tests say next to nothing of their spread: some are beyond all bounds
            found *= np.exp(apart)
    expected = sum(one.expected for one in tests)
    if expected > 0:  # the scale of the posterior by the jackknife, as uncertain as there are tests
        scale = sum(one.moved for one in tests) / expected
        found *= scale * len(tests) / random.chisquare(len(tests), _DRAWS)
    return np.asarray(found)


def _between(tests: Sequence[Evidence], count: int, random: np.random.Generator) -> FloatArray:
    """Draws of the logarithm of a new test's estimation error beside the mean of so many."""
    each = np.log(np.concatenate([one.whole for one in tests])) if tests else np.zeros(0)
    spread = float(np.std(each, ddof=1)) if len(each) > 1 else _TYPICAL_SPREAD
    return np.asarray(spread * np.sqrt(1 + 1 / count) * random.standard_t(max(len(each) - 1, 1), _DRAWS))


def _missed(hold_outs: Sequence[Evidence], spreads: FloatArray, random: np.random.Generator) -> FloatArray:
    """Draws of the share that the law misses in a new record."""
    levels, exact, inexact = _posterior(hold_outs, spreads)
    weights = np.concatenate([[exact], inexact.ravel()])
    drawn = random.choice(len(weights), _DRAWS, p=weights)
    level, spread = np.divmod(np.maximum(drawn - 1, 0), len(_SPREADS))
    found = np.exp(levels[level] + _SPREADS[spread] * random.standard_normal(_DRAWS))
    return np.where(drawn > 0, found, 0.0)


def _posterior(hold_outs: Sequence[Evidence], spreads: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Levels, the probability that the law is exact, and those of every level and spread, (levels, spreads)."""
    least = float(np.median(np.log(np.concatenate([one.whole for one in hold_outs]))))
    levels = np.linspace(min(least, -1.0), 0.0, _LEVELS)
    kernel = np.exp(-0.5 * ((_LOGS - levels[:, None, None]) / _SPREADS[:, None]) ** 2)
    kernel /= np.maximum(kernel.sum(axis=-1, keepdims=True), _TINY)
    inexact = np.log(np.maximum(spreads, _TINY) / _LEVELS) + np.log(1 - _EXACT)
    exact = np.log(_EXACT)
    for one in hold_outs:
        likelihood = np.exp(one.log_likelihood)
        inexact = inexact + np.log(kernel @ likelihood[1:] + _TINY)
        exact += one.log_likelihood[0]
    most = max(float(inexact.max()), exact)
    exact, inexact = float(np.exp(exact - most)), np.exp(inexact - most)
    total = exact + inexact.sum()
    return levels, exact / total, inexact / total


def _spread_between(tests: Sequence[Evidence]) -> FloatArray:
    """Probabilities of the spreads, from tests left out if there are any; as beforehand if the law is exact."""
    before = np.exp(-0.5 * (_SPREADS / _TYPICAL_SPREAD) ** 2)
    before /= before.sum()
    if not tests:
        return before
    _, exact, inexact = _posterior(tests, before)
    return np.asarray(exact * before + inexact.sum(axis=0))
