r"""Optimality criteria of a design: one number from the information of its tests, smaller is better.

Criteria for learning parameters use the covariance :math:`C = M^{-1}` of *relative* changes (`scales`), with M the
precision, of the chosen parameters s only; the others are nuisances:

==========  ==========================================================  ==========================================
criterion   value                                                       minimises
==========  ==========================================================  ==========================================
c           :math:`w^T C w`                                             variance of one parameter or combination w
D           :math:`(\det C_{ss})^{1/k}`                                 volume of the confidence ellipsoid
A           :math:`\operatorname{tr} C_{ss} / k`                        mean variance
E           :math:`\lambda_{\max}(C_{ss})`                              variance in the worst direction
==========  ==========================================================  ==========================================

The criterion for discriminating between effects (T) is `Discrimination`.

References
----------
Atkinson, Donev & Tobias, "Optimum experimental designs, with SAS", Oxford 2007, chapters 10 and 17 (averages over prior
samples); Pronzato & Pázman, "Design of experiments in nonlinear models", Springer 2013, chapter 8 (robust criteria);
Atkinson & Fedorov, "The design of experiments for discriminating between two rival models", Biometrika 62 (1975).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import Effect
from mofit.parameters import ParameterSpace

CRITERIA = ("c", "D", "A", "E")
AGGREGATES = ("mean", "worst")
#: Noncentrality from which two effects are discriminated: a test at 1 % then has a power of 97 %.
ENOUGH = 20.0

#: A parameter near zero changes relative to this share of its box instead.
_LEAST_SHARE = 0.01


def scales(space: ParameterSpace, values: FloatArray) -> FloatArray:
    """Change of each parameter that counts as a relative change of 1, shape (N, d), at values (N, d).

    The magnitude of the value, but at least a hundredth of the width of a linear parameter's box.
    """
    linear = np.array([parameter.scale == "linear" for parameter in space.parameters])
    least = np.where(linear, _LEAST_SHARE * (space.upper - space.lower), 0.0)
    return np.maximum(np.abs(values), least)


def box_precision(space: ParameterSpace, values: FloatArray) -> FloatArray:
    """Precision of a uniform distribution over the bounds, shape (N, d, d), for relative changes at values (N, d)."""
    sd = space.derivative(values) / np.sqrt(12.0)
    size = scales(space, values)
    return np.asarray(np.eye(len(space)) / sd[..., None, :] ** 2 * size[:, :, None] * size[:, None, :])


def over_samples(values: FloatArray, aggregate: str) -> FloatArray:
    """Values (..., N) by sample as one, (...): ``mean`` or ``worst``; infinite where a simulation fails."""
    usable = np.isfinite(values)
    safe = np.where(usable, values, 0.0)
    reduced = safe.mean(axis=-1) if aggregate == "mean" else safe.max(axis=-1)
    return np.asarray(np.where(usable.all(axis=-1), reduced, np.inf))


def sd_over_samples(sds: FloatArray, aggregate: str) -> FloatArray:
    """Standard deviations (..., N) by sample as one, (...), as a criterion sums up its own: by their logarithm."""
    return np.asarray(np.exp(over_samples(np.log(np.maximum(sds, np.finfo(float).tiny)), aggregate)))


@dataclass(frozen=True)
class Criterion:
    """A criterion for learning parameters."""

    name: str
    """One of `CRITERIA`."""
    weights: FloatArray
    """Chosen parameters, shape (k, d), or (N, k, d) by sample: unit rows for D, A and E; one row of weights of relative
    changes for c."""
    aggregate: str = "mean"
    """Over the parameter samples: ``mean`` of the logarithm, or the ``worst``."""
    #: Whether larger shown values are better.
    larger_is_better: ClassVar[bool] = False

    def __call__(self, precision: FloatArray) -> FloatArray:
        """Logarithm of the criterion, shape (...), from relative precisions (..., N, d, d)."""
        usable = np.asarray(np.isfinite(precision).all(axis=(-2, -1)))
        safe = np.where(usable[..., None, None], precision, np.eye(precision.shape[-1]))
        columns = np.broadcast_to(np.swapaxes(self.weights, -1, -2), (*safe.shape[:-1], self.weights.shape[-2]))
        covariance = self.weights @ np.linalg.solve(safe, columns)
        return over_samples(np.where(usable, _log_value(self.name, covariance), np.nan), self.aggregate)

    @staticmethod
    def shown(value: float) -> float:
        """A value as a relative standard deviation."""
        return float(np.exp(value / 2))


def _log_value(criterion: str, covariance: FloatArray) -> FloatArray:
    covariance = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
    tiny = np.finfo(float).tiny
    if criterion == "D":
        sign, value = np.linalg.slogdet(covariance)
        return np.asarray(np.where(sign > 0, value, -np.inf) / covariance.shape[-1])
    if criterion == "E":
        return np.asarray(np.log(np.maximum(np.linalg.eigvalsh(covariance)[..., -1], tiny)))
    return np.asarray(np.log(np.maximum(np.trace(covariance, axis1=-2, axis2=-1) / covariance.shape[-1], tiny)))


def parameter_criterion(
    name: str,
    names: Sequence[str],
    chosen: Sequence[str],
    combination: Mapping[str, float] | None = None,
    aggregate: str = "mean",
) -> Criterion:
    """The criterion for ``chosen`` parameters among all ``names``, which are in the order of the precision matrices.

    Criterion c takes one chosen parameter, or a combination by weights of relative changes:
    ``{"a": 1, "b": -1}`` is the ratio of the two.

    Raises
    ------
    InputError
        For unknown names, or a criterion that does not fit what was chosen.
    """
    combination = dict(combination or {})
    issues = [*_unknown("--criterion", name, CRITERIA), *_unknown("--robust", aggregate, AGGREGATES)]
    issues += [
        Issue(f"--parameter {parameter}", "the model has no such parameter", did_you_mean(parameter, names))
        for parameter in (*chosen, *combination)
        if parameter not in names
    ]
    raise_errors(issues)
    if name == "c":
        if not combination and len(chosen) != 1:
            count = f"{len(chosen)} parameters chosen"
            raise InputError.of("--criterion c", count, "Name one --parameter, or a --combination")
        combination = combination or {chosen[0]: 1.0}
        return Criterion(name, np.array([[combination.get(own, 0.0) for own in names]]), aggregate)
    if combination:
        raise InputError.of("--combination", f"goes with criterion c, not {name}", "Leave one of them out")
    if not chosen:
        raise InputError.of("--parameter", "no parameter is chosen", "Name at least one")
    return Criterion(name, np.eye(len(names))[[names.index(own) for own in chosen]], aggregate)


def _unknown(option: str, value: str, known: Collection[str]) -> list[Issue]:
    return [] if value in known else [Issue(option, f"'{value}' is unknown", did_you_mean(value, known))]


@dataclass(frozen=True)
class Discrimination:
    r"""How well tests discriminate between two effects, or one effect and none (T-optimality).

    If effect k is present with size a and effect l is fitted in its place, along with all parameters of the model, the
    residual has the squared length (whitened by the noise)

    .. math:: \lambda_{kl} = a^T \left[ F_{kk} - F_{kr} (F_{rr} + P)^{-1} F_{rk} \right] a
              = a^2 \left\| (I - P_{[J, S_l]}) S_k \right\|^2

    with F the Fisher information of the model with both effects at their neutral values, r all parameters but those of
    k, and P the prior precision of the model's own parameters. It is the noncentrality of the :math:`\chi^2` test of k
    beside l. Parameters that only shape an effect (a relaxation time, say) are fixed at the sample's values: at its
    neutral value an effect does not depend on them.
    """

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
    """The criterion for one or two effects of nominal size in a model's space, switched off in the samples (N, d).

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
    raise_errors([*issues, *_unknown("--robust", aggregate, AGGREGATES)])
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


def with_neutral(space: ParameterSpace, values: FloatArray, effects: Sequence[Effect]) -> FloatArray:
    """Values (d,) with the effects switched off: parameters that state a neutral value have it."""
    changed = values.copy()
    for parameter in (parameter for effect in effects for parameter in effect.parameters):
        if parameter.neutral is not None:
            changed[space.index(parameter.name)] = parameter.neutral
    return changed
