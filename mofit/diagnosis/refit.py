"""A model fitted again with one more effect, in full."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidate_model import price
from mofit.diagnosis.candidates import effects_moving
from mofit.diagnosis.few_periods import at_steps_for, few_periods, repeats
from mofit.diagnosis.fitting import Fitted, fit, in_wider_ranges
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.integration import MOST_STEPS, stable
from mofit.diagnosis.scoped_starts import with_best_values
from mofit.diagnosis.score_test import ScoreTest
from mofit.errors import InputError, MofitError

#: Grid points of an effect that a refit starts from, each twice: with the typical size no more than lanes.
_GRID_STARTS = 3
#: Starts along an effect that moves a condition of the tests: one per turn of the wheel; and how far they reach to each
#: side, in standard deviations of the effect's size.
_CONDITION_STARTS, _CONDITION_REACH = 13, 3.0
#: Most rounds of refitting the calibration stages and the model in turn, and the change of the log posterior at which
#: they end.
_ROUNDS, _TOLERANCE = 10, 0.1
#: Rounds in which a fit may crawl: it does so in all others, too.
_CRAWLING = 2
#: Largest decrease of the sum of squares to expect of the first of those rounds, generously.
_GAIN = 300.0


class NotFittedError(MofitError):
    """A candidate model could not be fitted; the message says why."""


def refit(fitted: Fitted, added: ScoreTest, limit: float = np.inf, known: float = np.inf) -> Fitted:
    """The hypothesis with one more effect, fitted from where the score test expects the minimum and from elsewhere.

    Starts: the fitted parameters, without and with their expected shift, at the expected size of the best points of the
    grid; the fitted parameters with the typical size. Where the added effect depends on a condition that a fitted
    effect moves, there are many minima side by side: then starts along that effect are added.

    What diverges is tried again with twice as many steps, from where it ended and from every point of the grid.

    Parameters
    ----------
    fitted
        The hypothesis without the effect.
    added
        The effect's score test there.
    limit
        Sum of squares and price of the effects that the model must come down to; one that cannot is left as it was
        found first: coarsely fitted and integrated, and the stages as they were.
    known
        Value of the minimum that the model must fall below to be of use; one that does not is left in the same way.

    Raises
    ------
    NotFittedError
        If with the most steps no start can be simulated, or the minimum cannot be integrated more finely.
    """
    old, here = fitted.hypothesis, fitted.minimum.point
    new = hypothesis(old.observed, (*old.discrepancies, added.discrepancy))
    limit -= price(new)
    grid = _best_points(added)
    least = max(old.steps, int(added.candidate.steps[grid[0]])) if added.effect.states else old.steps
    starts = [(least, one) for one in (_start(new, here, {}), *_along(new, fitted, added))]
    for place in grid:
        own = max(least, int(added.candidate.steps[place]))
        starts += [(own, one) for one in _expected(new, here, added, place)]
    steps, ends = least, list[Fitted]()
    # a heat that builds up shows in all periods alone
    alike = repeats(old.observed, added.candidate.sensitivities[added.best][: len(old.observed.measured)])
    while True:
        try:
            found = _fitted(new, starts, limit, fitted, known, alike)
            if found.minimum.value >= known:
                return found.without_tables()
            found = _ended(found, limit)
            if is_reliable(found):
                return found.without_tables()
            ends, why = [found], "its fit ends where the integration diverges"
        except InputError:
            ends, why = [], "no start can be simulated"
        steps *= 2
        if steps > MOST_STEPS:
            raise NotFittedError(f"{why}, even with {steps // 2} steps per sampling interval; sample faster")
        again = [_start(new, here, one.point) for one in added.candidate.discrepancies]
        more = [*again, *(_inside(new, one) for one in ends)]
        starts = [(max(own, steps), one) for own, one in [*starts, *((steps, one) for one in more)]]


def refit_from(fitted: Fitted, other: Fitted, limit: float = np.inf, known: float = np.inf) -> Fitted:
    """The hypothesis fitted again from the model's parameters of another one, its effects from where they are in both.

    ``limit`` and ``known`` are those of `refit`.

    Raises
    ------
    NotFittedError
        If no start can be simulated, or the minimum cannot be integrated more finely.
    """
    model, starts = fitted.hypothesis, []
    limit -= price(model)
    names, own = model.space.names, model.space.names[: model.own]
    for shared in (own, names):
        values = fitted.values | {name: value for name, value in other.values.items() if name in shared}
        starts.append(np.clip(model.space.to_unit([values[name] for name in names]), 0.0, 1.0))
    try:
        again = fit(at_steps_for(model, starts[0][None], model.steps), np.array(starts), limit, fitted, known=known)
        if again.minimum.value >= known:
            return again.without_tables()
        found = _ended(again, limit)
    except InputError as error:
        raise NotFittedError("no start can be simulated") from error
    if not is_reliable(found):
        raise NotFittedError("its fit ends where the integration diverges")
    return found.without_tables()


def _fitted(
    new: Hypothesis,
    starts: Sequence[tuple[int, FloatArray]],
    limit: float,
    beside: Fitted,
    known: float,
    alike: bool,
) -> Fitted:
    """The best fit from starts, each with as many integration steps as it needs.

    Raises
    ------
    InputError
        If no start can be simulated.
    """
    found, failure = list[Fitted](), InputError([])
    for steps in sorted({own for own, _ in starts}):
        try:
            own = np.array([start for needed, start in starts if needed == steps])
            found.append(fit(new.with_steps(steps), own, limit, beside, known=known, repeats=alike))
        except InputError as error:
            failure = error
    if not found:
        raise failure
    return min(found, key=lambda one: one.minimum.value)


def _ended(found: Fitted, limit: float) -> Fitted:
    """The fit with its stages settled, in ranges wide enough for it."""
    return in_wider_ranges(settled(found, limit, partial(with_stages, limit=limit)), limit)


def _inside(new: Hypothesis, found: Fitted) -> FloatArray:
    """Where a fit in maybe wider ranges ended, in the unit coordinates of a hypothesis."""
    values = found.hypothesis.space.from_unit(found.minimum.point)
    return np.clip(new.space.to_unit(values), 0.0, 1.0)


def is_reliable(found: Fitted) -> bool:
    """Whether the minimum can be simulated with half the step, and its derivatives are those of a stable integration.

    A softened spring may be stable by rounding alone; and a divergent derivative says nothing of a parameter. Judged by
    a few periods where the inputs repeat.
    """
    if not stable(found.jacobian):
        return False
    few = few_periods(found.hypothesis)
    model = few.hypothesis if few else found.hypothesis
    finer = model.with_steps(2 * model.steps)
    return bool(finer.stays_finite(found.minimum.point[None]).all())


def settled(found: Fitted, limit: float, again: Callable[[Fitted], Fitted]) -> Fitted:
    """The model and the stages that its effects are present in, fitted in turn until nothing changes.

    Or until the model would not reach the ``limit`` of `refit` at the pace of the last round; ``again`` is one round,
    see `with_stages`. Where the fits alternate between two minima, the stages were never fitted where the effects
    ended: the worse of both counts.
    """
    before, gain, crawled = found, _GAIN, 0
    for left in reversed(range(_ROUNDS)):
        if 2 * found.minimum.value - limit > gain:
            return found
        before, found = found, again(found)
        change = abs(found.minimum.value - before.minimum.value)
        gain = 2 * left * change
        alone = not any(one.present_in_calibration for one in found.hypothesis.discrepancies)
        crawled += not found.minimum.converged
        if change < _TOLERANCE or (alone and found.minimum.converged) or crawled == _CRAWLING:
            return found
    return max(before, found, key=lambda one: one.minimum.value)


def with_stages(fitted: Fitted, limit: float = np.inf) -> Fitted:
    """The stages fitted again where the effects ended, those present in the stages' tests; then the model once more.

    It stays where it is if that is a minimum, and neither the stages nor the steps of its integration change. ``limit``
    is that of `refit`.
    """
    model, best, stages = fitted.hypothesis, fitted.minimum.point[None], fitted.hypothesis.observed.stages
    present = [one.present_in_calibration for one in model.discrepancies]
    discrepancies = [
        stages.recalibrated(one, fitted.values) if here else one
        for one, here in zip(model.discrepancies, present, strict=True)
    ]
    again = at_steps_for(replace(model, discrepancies=tuple(discrepancies)), best, model.steps)
    stays = fitted.minimum.converged and not any(present) and again.steps == model.steps
    return fitted if stays else fit(again, best, limit)


def _best_points(added: ScoreTest) -> list[int]:
    """The points of the grid with the largest statistics, the best first.

    Others than the best only if they are not too stiff to be fitted in reasonable time; none of an effect with values
    per test, whose starts are dear.
    """
    if added.effect.scoped:
        return [added.best]
    points = added.candidate.discrepancies
    present = added.discrepancy.present_in_calibration
    order = [int(i) for i in np.argsort(-added.statistics, kind="stable")]
    best, *others = [i for i in order if points[i].present_in_calibration == present]
    return [best, *(i for i in others if added.candidate.steps[i] <= MOST_STEPS)][:_GRID_STARTS]


def _expected(new: Hypothesis, here: FloatArray, added: ScoreTest, place: int) -> Iterator[FloatArray]:
    """Where the score test expects the minimum at a point of the grid, without and with the parameters' shift."""
    values = added.candidate.columns.values(added.effect, added.sizes[place])
    values |= added.candidate.discrepancies[place].point
    for base in (here, np.clip(here - added.biases[place], 0.0, 1.0)):
        start = _start(new, base, values)
        yield with_best_values(new, start, added.effect) if added.effect.scoped else start


def _along(new: Hypothesis, fitted: Fitted, added: ScoreTest) -> Iterator[FloatArray]:
    """The fitted parameters, one that moves a condition which the added effect needs varied, without the added one."""
    here, sd = _start(new, fitted.minimum.point, added.effect.neutral), fitted.sd()
    moving = [name for effect in effects_moving(fitted, added.effect.needs) for name in effect.size]
    for column in [column for name in moving for column in new.layout.coordinates(name)]:
        for step in np.linspace(-_CONDITION_REACH, _CONDITION_REACH, _CONDITION_STARTS):
            start = here.copy()
            start[column] = np.clip(start[column] + step * sd[column], 0.0, 1.0)
            yield start


def _start(new: Hypothesis, base: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """A point of the new space: the old parameters, and values of the new ones, typical if not given, in bounds."""
    fresh = new.space.parameters[len(base) :]
    given = [float(np.clip(values.get(p.name, p.nominal), p.lower, p.upper)) for p in fresh]
    return np.concatenate([base, new.space.subset([p.name for p in fresh]).to_unit(given)])
