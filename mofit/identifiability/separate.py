r"""How well tests tell two effects apart: the noncentrality of the test between them (T-optimality).

If effect k is present with size a and effect l is what is fitted instead, along with all parameters of the model, what
stays unexplained has the squared length (whitened by the noise)

.. math:: \lambda_{kl} = a^T \left[ F_{kk} - F_{kr} (F_{rr} + P)^{-1} F_{rk} \right] a
          = a^2 \left\| (I - P_{[J, S_l]}) S_k \right\|^2

with F the Fisher information of the model with both effects at their neutral values, r all parameters but those of k,
and P what is known of the model's own beforehand. It is the noncentrality of the :math:`\chi^2` test of k beside l:
about 20 are needed to be sure. Parameters that only shape an effect (a relaxation time, say), are held at the values
given: at its neutral value an effect does not show them.

References
----------
Atkinson & Fedorov, "The design of experiments for discriminating between two rival models", Biometrika 62 (1975).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Procedure
from mofit.errors import InputError
from mofit.identifiability.criteria import box_precision, scales
from mofit.identifiability.fisher import test_information
from mofit.identifiability.noise import ChannelNoise
from mofit.model import Effect, Model, with_effects
from mofit.parameters import Parameter, ParameterSpace

Array = NDArray[np.float64]

#: Noncentrality from which two effects are told apart.
ENOUGH = 20.0


def strength(effect: Effect) -> tuple[str, ...]:
    """Parameters that make an effect vanish at their neutral values.

    Raises
    ------
    InputError
        If it has none.
    """
    names = tuple(parameter.name for parameter in effect.parameters if parameter.neutral is not None)
    if not names:
        raise InputError.of(
            f"effect '{effect.name}'", "no parameter states a neutral value", "Give one a neutral value"
        )
    return names


def neutral_values(model: Model, effects: Sequence[Effect], values: Mapping[str, float]) -> dict[str, float]:
    """Values of all parameters of the model with effects that do not act: strengths neutral, the rest as given."""
    parameters: list[Parameter] = [*model.parameters, *(p for effect in effects for p in effect.parameters)]
    found = {p.name: p.nominal for p in parameters} | dict(values)
    return found | {p.name: p.neutral for effect in effects for p in effect.parameters if p.neutral is not None}


def _sizes(effects: Sequence[Effect], given: Mapping[str, float] | None = None) -> dict[str, float]:
    """How far each strength is from neutral where its effect is present: as given, else nominal."""
    given = given or {}
    return {
        p.name: given.get(p.name, p.nominal - p.neutral)
        for effect in effects
        for p in effect.parameters
        if p.neutral is not None
    }


@dataclass(frozen=True)
class Rivalry:
    """Which of two effects is there (or whether one is), as an objective over information matrices.

    Parameters
    ----------
    sides
        Places of the strengths of the first effect, and of the second if there is one.
    others
        Places of the model's own parameters.
    amounts
        Sizes of the strengths of each side, in the units of the information.
    prior
        What is known of the model's own beforehand, (N, d, d), in the units of the information; strengths have none.
    aggregate
        Over the parameter points: ``mean`` of the logarithm, or the ``worst``.
    """

    sides: tuple[tuple[int, ...], ...]
    others: tuple[int, ...]
    amounts: tuple[tuple[float, ...], ...]
    prior: Array
    aggregate: str = "mean"

    def noncentrality(self, information: Array) -> Array:
        r""":math:`\lambda` of each side against the other, (..., N, sides)."""
        total = information + self.prior
        found = []
        for number, side in enumerate(self.sides):
            rival = self.sides[1 - number] if len(self.sides) > 1 else ()
            rest = [*self.others, *rival]
            found.append(_unexplained(total, list(side), rest, np.array(self.amounts[number])))
        return np.stack(found, axis=-1)

    def __call__(self, information: Array) -> Array:
        r""":math:`-\log \min \lambda`, mean or worst over the points; infinite where a simulation fails."""
        least = self.noncentrality(information).min(axis=-1)
        values = -np.log(np.maximum(least, np.finfo(float).tiny))
        whole = np.isfinite(least).all(axis=-1)
        reduced = values.mean(axis=-1) if self.aggregate == "mean" else values.max(axis=-1)
        return np.asarray(np.where(whole, reduced, np.inf))


def _unexplained(total: Array, side: list[int], rest: list[int], amounts: Array) -> Array:
    usable = np.asarray(np.isfinite(total).all(axis=(-2, -1)))
    total = np.where(usable[..., None, None], total, np.eye(total.shape[-1]))
    own, cross, other = (
        total[..., np.array(a)[:, None], np.array(b)[None, :]] for a, b in ((side, side), (rest, side), (rest, rest))
    )
    # a strength that nothing shows has neither row nor column
    scale = np.sqrt(np.maximum(np.diagonal(other, axis1=-2, axis2=-1), np.finfo(float).tiny))
    even = other / (scale[..., :, None] * scale[..., None, :])
    cross = cross / scale[..., :, None]
    explained = np.swapaxes(cross, -1, -2) @ np.linalg.pinv(even, rcond=1e-12, hermitian=True) @ cross
    value = np.einsum("...ij,i,j->...", own - explained, amounts, amounts)
    return np.asarray(np.where(usable, np.maximum(value, 0.0), np.nan))


def rivalry(space: ParameterSpace, values: Array, effects: Sequence[Effect], aggregate: str = "mean") -> Rivalry:
    """One or two effects of nominal size as an objective over relative information (`mofit.identifiability.criteria`).

    Parameters
    ----------
    space
        Parameters of the model with the effects.
    values
        Parameter points (N, d), strengths neutral.
    effects
        The effects.
    aggregate
        ``mean`` or ``worst``.
    """
    size = scales(space, values)
    amounts, sides = _sizes(effects), [strength(effect) for effect in effects]
    places = tuple(tuple(space.index(name) for name in side) for side in sides)
    taken = [place for side in places for place in side]
    prior = box_precision(space, values) * size[:, :, None] * size[:, None, :]
    prior[:, taken, taken] = 0.0
    return Rivalry(
        sides=places,
        others=tuple(place for place in range(len(space)) if place not in taken),
        amounts=tuple(tuple(amounts[name] / size[0, space.index(name)] for name in side) for side in sides),
        prior=prior,
        aggregate=aggregate,
    )


def separation(
    model: Model,
    effects: Sequence[Effect],
    procedures: Sequence[Procedure],
    values: Mapping[str, float],
    noise: Mapping[str, ChannelNoise],
    *,
    size: Mapping[str, float] | None = None,
    precision: Array | None = None,
    jobs: int = 1,
) -> Array:
    r"""Noncentrality :math:`\lambda_{kl}` that each procedure alone would give for every pair of effects.

    Parameters
    ----------
    model
        The model that all effects can join.
    effects
        The rivals, K of them.
    procedures
        The tests, T of them.
    values
        Parameters of the model, and shapes of effects, by name in SI units; nominal where left out.
    noise
        By output.
    size
        How far strengths are from neutral, by name; nominal where left out.
    precision
        What is known beforehand of the model's own parameters, (d, d) in SI units; the identification's own, say.
    jobs
        Threads; results do not depend on it.

    Returns
    -------
    Array
        Shape (T, K, K): row k, column l is the effect k present and l fitted in its place; on the diagonal k is present
        and nothing is fitted but the model.
    """
    own = [parameter.name for parameter in model.parameters]
    found = np.zeros((len(procedures), len(effects), len(effects)))
    pairs = [(k, l) for k in range(len(effects)) for l in range(k, len(effects))]  # noqa: E741 - as in the formula
    for k, other in pairs:
        both = [effects[k]] if k == other else [effects[k], effects[other]]
        extended = with_effects(model, *both)
        sides = [strength(effect) for effect in both]
        names = [*own, *(name for side in sides for name in side)]
        point = neutral_values(model, both, values)
        at = np.array([[point[parameter.name] for parameter in extended.parameters]])
        information = test_information(extended, procedures, at, noise, names, jobs)[0]
        prior = np.zeros((len(names), len(names)))
        if precision is not None:
            prior[: len(own), : len(own)] = precision
        told = Rivalry(
            sides=tuple(tuple(names.index(name) for name in side) for side in sides),
            others=tuple(range(len(own))),
            amounts=tuple(tuple(_sizes(both, size)[name] for name in side) for side in sides),
            prior=prior,
        ).noncentrality(information)
        if k == other:
            found[:, k, k] = told[:, 0]
        else:
            found[:, k, other], found[:, other, k] = told[:, 0], told[:, 1]
    return found
