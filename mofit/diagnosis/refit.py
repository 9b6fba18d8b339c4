"""Explanations fitted in full, from several starts each, and weighed against each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from mofit.diagnosis.baseline import Fitted, fit
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.screen import Screened
from mofit.errors import InputError

Array = NDArray[np.float64]

#: Grid points of an effect that a refit starts from.
_POINTS = 4


@dataclass(frozen=True)
class Explanation:
    r"""A fitted hypothesis with its information criterion.

    .. math:: \mathrm{EBIC} = \|r\|^2 + q \log n + 2 \log \binom{c}{k}

    with all white squares (prior included) :math:`\|r\|^2`, q parameters of the k effects, n rows that may hold a gap,
    and c candidates: the last term is the price of having chosen (Chen & Chen 2008).
    """

    fitted: Fitted
    criterion: float

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


def refit(fitted: Fitted, added: Sequence[Screened]) -> Fitted | None:
    """The hypothesis with these effects added, fitted from where the screen expects the minimum and from elsewhere.

    Starts: the fitted parameters and their expected shift, with the expected size, at every good point of the grids;
    the fitted parameters with the typical size; the parameters nominal. None if no start can be simulated.
    """
    old, here = fitted.hypothesis, fitted.minimum.point
    new = hypothesis(old.observed, (*old.effects, *(found.candidate.effect for found in added)))
    starts = [start for k in range(_POINTS) for start in _expected(new, fitted, added, k)]
    typical = {p.name: p.nominal for found in added for p in found.candidate.effect.parameters}
    starts.append(_start(new, here, typical))
    try:
        new = new.at_steps_for(starts[0][None])
        found = fit(new, np.unique(np.array(starts), axis=0))
        sure = found.hypothesis.at_steps_for(found.minimum.point[None])
        return fit(sure, found.minimum.point[None])
    except InputError:
        return None


def _expected(new: Hypothesis, fitted: Fitted, added: Sequence[Screened], rank: int) -> Iterable[Array]:
    """Where the screen expects the minimum, each effect at the point of its grid with that rank of T."""
    values: dict[str, float] = {}
    shift = np.zeros(len(fitted.minimum.point))
    fresh = rank == 0
    for found in added:
        order = np.argsort(-found.statistics, kind="stable")
        place = int(order[min(rank, len(order) - 1)])
        fresh |= rank < len(order)
        effect = found.candidate.effect
        for name, size in zip(effect.size, found.sizes[place], strict=True):
            values[name] = effect.neutral[name] + float(size)
        values |= found.candidate.grid[place]
        shift -= found.shifts[place]
    if not fresh:
        return
    yield _start(new, fitted.minimum.point, values)
    yield _start(new, np.clip(fitted.minimum.point + shift, 0.0, 1.0), values)


def _start(new: Hypothesis, base: Array, values: Mapping[str, float]) -> Array:
    """A point of the new space: the old parameters, and values of the new ones, inside their bounds."""
    old = len(base)
    point = np.empty(len(new.space))
    point[:old] = base
    for i, parameter in enumerate(new.space.parameters[old:], start=old):
        value = float(np.clip(values.get(parameter.name, parameter.nominal), parameter.lower, parameter.upper))
        point[i] = new.space.subset([parameter.name]).to_unit([value])[0]
    return point
