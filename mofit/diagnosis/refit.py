"""Explanations fitted in full, from several starts each, and weighed against each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from mofit.diagnosis.baseline import Fitted, fit
from mofit.diagnosis.candidates import moving
from mofit.diagnosis.cause import recalibrated
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.screen import Screened
from mofit.diagnosis.steps import bounded
from mofit.errors import InputError

Array = NDArray[np.float64]

#: Grid points of an effect that a refit starts from, each twice; with the typical size no more starts than lanes.
_POINTS = 3
#: Starts along an effect that moves a condition of the tests, in standard deviations of its size.
_ALONG = np.linspace(-3, 3, 13)
#: Times that the stages are looked at anew, and the change of the log posterior at which that ends.
_ROUNDS, _STANDS = 10, 0.1
#: White squares that the first of those may gain, generously.
_GAIN = 300.0


@dataclass(frozen=True)
class Explanation:
    r"""A fitted hypothesis with its information criterion.

    .. math:: \mathrm{EBIC} = \|r\|^2 + q \log n + 2 \log \binom{c}{k}

    with all white squares (prior included) :math:`\|r\|^2`, q parameters of the k effects, n rows that may hold a gap,
    and c candidates: the last term is the price of having chosen (Chen & Chen 2008).

    Attributes
    ----------
    other_way
        The same effects, the last one in the calibration tests where here it is not, or the reverse, if that was fitted
        too; its criterion is no smaller.
    """

    fitted: Fitted
    criterion: float
    other_way: Explanation | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted(effect.name for effect in self.fitted.hypothesis.effects))


def explain(fitted: Fitted, candidates: int) -> Explanation:
    """Weigh a fitted hypothesis that was chosen among so many candidates."""
    model = fitted.hypothesis
    chosen = len(model.effects)
    rows = int(model.observed.repeating.sum())
    extra = sum(len(effect.parameters) for effect in model.effects)
    choices = gammaln(candidates + 1) - gammaln(chosen + 1) - gammaln(candidates - chosen + 1)
    value = float(fitted.residual @ fitted.residual)
    return Explanation(fitted, value + extra * float(np.log(rows)) + 2 * float(choices))


def refit(fitted: Fitted, added: Sequence[Screened], limit: float = np.inf) -> Fitted | None:
    """The hypothesis with these effects added, fitted from where the screen expects the minimum and from elsewhere.

    Starts: the fitted parameters, and their expected shift, with the expected size, at every good point of the grids;
    the fitted parameters with the typical size. None if no start can be simulated, or if what was found runs away when
    it is integrated more finely.

    Where what is added turns with a condition that a fitted effect moves, there are many minima side by side: then
    starts along that effect are added.

    What cannot be hoped to come down to ``limit`` white squares is left as it was found first: coarsely integrated, and
    the stages as they were.
    """
    old, here = fitted.hypothesis, fitted.minimum.point
    new = hypothesis(old.observed, (*old.causes, *(found.cause for found in added)))
    starts = [_start(new, here, {})]
    starts += [start for rank in range(_POINTS) for start in _expected(new, here, added, rank)]
    starts += [start for found in added for start in _along(new, fitted, found)]
    try:
        found = _settled(fit(new.with_steps(_steps(old, added)), np.array(starts)), limit)
    except InputError:
        return None
    return found.put_away() if _holds(found) else None


def _holds(found: Fitted) -> bool:
    """Whether the minimum can be simulated with half the step: a softened spring may hold by rounding alone.

    And whether its slopes are those of a stable integration: nothing can be told of its parameters otherwise.
    """
    if not bounded(found.jacobian):
        return False
    model = found.hypothesis
    finer = model.with_steps(2 * (model.simulator.steps or 1))
    return bool(np.isfinite(finer.evaluate(found.minimum.point[None])[0]).all())


def _steps(old: Hypothesis, added: Sequence[Screened]) -> int:
    """Steps that served the parts of a new hypothesis; the minimum is looked at more closely."""
    return max([old.simulator.steps or 1, *(found.candidate.steps for found in added if found.effect.states)])


def _settled(found: Fitted, limit: float) -> Fitted:
    """Fitted with the stages looked at where its effects end, until that stands: a large effect bends what it moves.

    Or until it would not reach the limit at the pace of the last round.

    Where it goes to and fro, the stages were never looked at where the effects ended: the worse of both ends counts.
    """
    before, gain = found, _GAIN
    for left in reversed(range(_ROUNDS)):
        if 2 * found.minimum.value - limit > gain:
            return found
        best = found.minimum.point[None]
        before, found = found, fit(_recalibrated(found).at_steps_for(best), best)
        change = abs(found.minimum.value - before.minimum.value)
        gain = 2 * left * change
        if change < _STANDS or not any(cause.everywhere for cause in found.hypothesis.causes):
            return found
    return max(before, found, key=lambda one: one.minimum.value)


def _recalibrated(fitted: Fitted) -> Hypothesis:
    """The hypothesis with the stages looked at where its effects ended, those that the stages' tests had too."""
    model = fitted.hypothesis
    space, calibrations = model.observed.problem.space, model.observed.calibrations
    causes = [
        recalibrated(cause, fitted.values, space, calibrations, model.observed.workshop) if cause.everywhere else cause
        for cause in model.causes
    ]
    return replace(model, causes=tuple(causes))


def _expected(new: Hypothesis, here: Array, added: Sequence[Screened], rank: int) -> Iterator[Array]:
    """Where the screen expects the minimum, each effect at the point of its grid with that rank of T."""
    values: dict[str, float] = {}
    shift, fresh = np.zeros(len(here)), False
    for found in added:
        causes = found.candidate.causes
        order = [
            i for i in np.argsort(-found.statistics, kind="stable") if causes[i].everywhere == found.cause.everywhere
        ]
        fresh |= rank < len(order)
        place = order[min(rank, len(order) - 1)]
        for name, size in zip(found.effect.size, found.sizes[place], strict=True):
            values[name] = found.effect.neutral[name] + float(size)
        values |= causes[place].point
        shift -= found.shifts[place]
    if fresh:
        yield _start(new, here, values)
        yield _start(new, np.clip(here + shift, 0.0, 1.0), values)


def _along(new: Hypothesis, fitted: Fitted, added: Screened) -> Iterator[Array]:
    """The fitted parameters, one that moves a condition which the added effect needs varied, without the added one."""
    here, sd = _start(new, fitted.minimum.point, added.effect.neutral), fitted.sd()
    for name in [name for effect in moving(fitted, added.effect.needs) for name in effect.size]:
        column = new.space.index(name)
        for step in _ALONG:
            start = here.copy()
            start[column] = np.clip(start[column] + step * sd[column], 0.0, 1.0)
            yield start


def _start(new: Hypothesis, base: Array, values: Mapping[str, float]) -> Array:
    """A point of the new space: the old parameters, and values of the new ones, typical if not given, in bounds."""
    fresh = new.space.parameters[len(base) :]
    given = [float(np.clip(values.get(p.name, p.nominal), p.lower, p.upper)) for p in fresh]
    return np.concatenate([base, new.space.subset([p.name for p in fresh]).to_unit(given)])
