"""Wider ranges: where the best fit lies at the end of a range, the range was wrong."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.descents import descend, settings_for
from mofit.identification.problem_setup import ProblemSetup, set_up_problem
from mofit.optimize import Minimum, merge
from mofit.parameters import ParameterSpace
from mofit.problem import CampaignPosterior
from mofit.problem.scoped_estimates import scoped_at_bound

#: Nats that the fit must gain beyond an end for the range to be widened: two standard deviations. Less is what a flat
#: direction gives, and a lower or upper limit is all that the data know.
WORTH = 2.0
#: Times that a range may be widened, each time tenfold.
MOST = 6
#: Starts beyond the end, as shares of the new part of the range.
_BEYOND = (0.02, 0.2, 0.6)


@dataclass(frozen=True)
class Widening:
    """A range that was widened."""

    name: str
    unit: str
    before: tuple[float, float]
    after: tuple[float, float]

    def __str__(self) -> str:
        (old_low, old_high), (low, high) = self.before, self.after
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"The range of {self.name} was widened from {old_low:.4g} … {old_high:.4g} to {low:.4g} … {high:.4g}{unit} "
            "and searched again: the best fit lay at its end."
        )


def widenings(before: ParameterSpace, after: ParameterSpace) -> tuple[Widening, ...]:
    """What differs between the ranges of two spaces of the same parameters."""
    return tuple(
        Widening(old.name, old.unit, (old.lower, old.upper), (new.lower, new.upper))
        for old, new in zip(before.parameters, after.parameters, strict=True)
        if (old.lower, old.upper) != (new.lower, new.upper)
    )


def wider_setup(
    setup: ProblemSetup, posterior: CampaignPosterior, minimum: Minimum, campaign: Campaign, tests: Sequence[str]
) -> ProblemSetup | None:
    """The problem in ranges wide enough for its best minimum, found by local descents; None where they are.

    Parameters
    ----------
    setup, posterior, minimum
        The problem, its posterior with noise estimated, and the best minimum.
    campaign, tests
        What it was set up from.
    """
    best, noise, shared = None, posterior.main.noise, len(setup.space)
    values, sides = posterior.space.from_unit(minimum.point)[:shared], minimum.at_bound[:shared]
    for _ in range(MOST):
        space = (best or setup).space.farther(sides)
        if space == (best or setup).space:
            break
        wider = set_up_problem(
            setup.model, campaign, setup.settings, tests, space=space, done=setup.calibrations, leads=setup.leads
        )
        wider = replace(wider, scoped=setup.scoped, known=posterior.main.experiments, start=setup.start)
        target = wider.posterior.with_noise(noise)
        starts = _with_hyperparameters(beyond_ends((best or setup).space, space, values, sides), minimum.point)
        (cost, *_), *_ = target.evaluate(starts[:1])
        (found, *_) = merge(descend(target, starts, settings_for(target.main))) or (None,)
        if found is None or not cost - found.value > WORTH:
            break
        best, values, sides = wider, space.from_unit(found.point[:shared]), found.at_bound[:shared]
    return best


def wider_scoped(setup: ProblemSetup, posterior: CampaignPosterior, minimum: Minimum) -> ProblemSetup | None:
    """The problem in ranges of the scoped parameters wide enough for their values at its minimum; None where they are.

    Scoped values are fitted, not searched: those at an end are fitted again in a range tenfold as wide. Pooled ones
    keep their ranges, in which their mean and spread are searched.
    """
    now, target, moved = setup, posterior, set[str]()
    for _ in range(MOST):  # far from the values a single step gains next to nothing
        held = scoped_at_bound(target.main, minimum.point)
        wider = _with_wider(now, held)
        if wider.fitted == now.fitted:
            break
        now, target, moved = wider, wider.posterior.with_noise(posterior.main.noise), moved | {*held}
    (before, *_), (after, *_) = (one.evaluate(minimum.point[None])[0] for one in (posterior, target))
    # once more, since at another minimum the values may lie a little farther
    return _with_wider(now, moved) if before - after > WORTH else None


def _with_wider(setup: ProblemSetup, names: Collection[str]) -> ProblemSetup:
    """The problem with wider ranges of the scoped parameters of these names that are not pooled."""
    widened = [one.wider() if one.name in names and not one.pooled else one for one in setup.scoped.parameters]
    return replace(setup, scoped=ParameterSpace(tuple(widened)))


def _with_hyperparameters(starts: FloatArray, point: FloatArray) -> FloatArray:
    """Starts (k, d) with the means and spreads of pooled parameters, which come last, as in a point."""
    rest = np.tile(point[starts.shape[1] :], (len(starts), 1))
    return np.concatenate([starts, rest], axis=1)


def beyond_ends(old: ParameterSpace, new: ParameterSpace, values: FloatArray, sides: NDArray[np.int64]) -> FloatArray:
    """Starts in a wider space (k, d): the point, and points beyond the ends of the old ranges that it lies at.

    Parameters
    ----------
    old, new
        The spaces.
    values
        The point (d,).
    sides
        -1 where it lies at the lower end of the old range, 1 at the upper, else 0; shape (d,).
    """
    here = np.clip(new.to_unit(values), 0.0, 1.0)
    starts = [here]
    ends = np.clip(new.to_unit(np.where(sides > 0, old.upper, old.lower)), 0.0, 1.0)
    for share in _BEYOND:
        beyond = np.where(sides > 0, ends + share * (1 - ends), ends * (1 - share))
        starts.append(np.where(sides != 0, beyond, here))
    return np.array(starts)
