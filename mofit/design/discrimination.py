r"""How well tests discriminate between two effects: the noncentrality of the test between them (T-optimality).

If effect k is present with size a and effect l is fitted in its place, along with all parameters of the model, the
residual has the squared length (whitened by the noise)

.. math:: \lambda_{kl} = a^T \left[ F_{kk} - F_{kr} (F_{rr} + P)^{-1} F_{rk} \right] a
          = a^2 \left\| (I - P_{[J, S_l]}) S_k \right\|^2

with F the Fisher information of the model with both effects at their neutral values, r all parameters but those of k,
and P the prior precision of the model's own parameters. It is the noncentrality of the :math:`\chi^2` test of k beside
l. Parameters that only shape an effect (a relaxation time, say) are fixed at the sample's values: at its neutral value
an effect does not depend on them.

References
----------
Atkinson & Fedorov, "The design of experiments for discriminating between two rival models", Biometrika 62 (1975).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mofit._typing import FloatArray
from mofit.design.criteria import AGGREGATES, box_precision, over_samples, scales
from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.models import Effect
from mofit.parameters import ParameterSpace

#: Noncentrality from which two effects are discriminated: a test at 1 % then has a power of 97 %.
ENOUGH = 20.0


def with_neutral(space: ParameterSpace, values: FloatArray, effects: Sequence[Effect]) -> FloatArray:
    """Values (d,) with the effects switched off: parameters that state a neutral value have it."""
    changed = values.copy()
    for parameter in (parameter for effect in effects for parameter in effect.parameters):
        if parameter.neutral is not None:
            changed[space.index(parameter.name)] = parameter.neutral
    return changed


@dataclass(frozen=True)
class Discrimination:
    """A criterion for discriminating between two effects, or between one effect and none."""

    sides: tuple[tuple[int, ...], ...]
    """Places of the size parameters of the first effect, and of the second if there is one."""
    others: tuple[int, ...]
    """Places of the model's own parameters."""
    sizes: tuple[tuple[float, ...], ...]
    """Size of each side's parameters, in the units of the information."""
    prior: FloatArray
    """Prior precision of the model's own parameters, (N, d, d), in the units of the information."""
    aggregate: str = "mean"
    """Over the parameter samples: ``mean`` of the logarithm, or the ``worst``."""
    name: ClassVar[str] = "T"
    #: Whether larger shown values are better.
    larger_is_better: ClassVar[bool] = True

    def noncentrality(self, fisher: FloatArray) -> FloatArray:
        r""":math:`\lambda` of each side against the other, (..., N, sides)."""
        total = fisher + self.prior
        found = []
        for number, side in enumerate(self.sides):
            competing = self.sides[1 - number] if len(self.sides) > 1 else ()
            found.append(_unexplained(total, list(side), [*self.others, *competing], np.array(self.sizes[number])))
        return np.stack(found, axis=-1)

    def __call__(self, fisher: FloatArray) -> FloatArray:
        r""":math:`-\log \min \lambda`, shape (...), from relative Fisher information (..., N, d, d)."""
        least = self.noncentrality(fisher).min(axis=-1)
        return over_samples(-np.log(np.maximum(least, np.finfo(float).tiny)), self.aggregate)

    @staticmethod
    def shown(value: float) -> float:
        """A value as a noncentrality."""
        return float(np.exp(-value))


def _unexplained(total: FloatArray, side: list[int], rest: list[int], sizes: FloatArray) -> FloatArray:
    usable = np.asarray(np.isfinite(total).all(axis=(-2, -1)))
    total = np.where(usable[..., None, None], total, np.eye(total.shape[-1]))
    own, cross, other = (
        total[..., np.array(a)[:, None], np.array(b)[None, :]] for a, b in ((side, side), (rest, side), (rest, rest))
    )
    # a size parameter without information has neither row nor column
    scale = np.sqrt(np.maximum(np.diagonal(other, axis1=-2, axis2=-1), np.finfo(float).tiny))
    even = other / (scale[..., :, None] * scale[..., None, :])
    cross = cross / scale[..., :, None]
    explained = np.swapaxes(cross, -1, -2) @ np.linalg.pinv(even, rcond=1e-12, hermitian=True) @ cross
    value = np.einsum("...ij,i,j->...", own - explained, sizes, sizes)
    return np.asarray(np.where(usable, np.maximum(value, 0.0), np.nan))


def discrimination(
    space: ParameterSpace, samples: FloatArray, effects: Sequence[Effect], aggregate: str = "mean"
) -> Discrimination:
    """The criterion for one or two effects of nominal size, from relative information (`mofit.design.criteria`).

    Parameters
    ----------
    space
        Parameters of the model with the effects.
    samples
        Parameter samples (N, d), the effects switched off.
    effects
        The effects.
    aggregate
        ``mean`` or ``worst``.

    Raises
    ------
    InputError
        If an effect states no neutral value, or the aggregate is unknown.
    """
    sized = [[parameter for parameter in effect.parameters if parameter.neutral is not None] for effect in effects]
    issues = [
        Issue(f"effect '{effect.name}'", "no parameter states a neutral value", "Give one a neutral value")
        for effect, own in zip(effects, sized, strict=True)
        if not own
    ]
    if aggregate not in AGGREGATES:
        issues.append(Issue("--robust", f"unknown aggregate '{aggregate}'", did_you_mean(aggregate, AGGREGATES)))
    raise_errors(issues)
    scale = scales(space, samples)
    places = tuple(tuple(space.index(parameter.name) for parameter in own) for own in sized)
    taken = [place for side in places for place in side]
    prior = box_precision(space, samples)
    prior[:, taken, taken] = 0.0
    return Discrimination(
        sides=places,
        others=tuple(place for place in range(len(space)) if place not in taken),
        sizes=tuple(
            tuple((p.nominal - float(p.neutral or 0.0)) / scale[0, space.index(p.name)] for p in own) for own in sized
        ),
        prior=prior,
        aggregate=aggregate,
    )
