r"""Optimality criteria of a design: one number from the precision matrix M, smaller is better.

All criteria use the covariance :math:`C = M^{-1}` of *relative* changes (`scales`), of the chosen parameters s only;
the others are nuisances:

==========  ==========================================================  ==========================================
criterion   value                                                       minimises
==========  ==========================================================  ==========================================
c           :math:`w^T C w`                                             variance of one parameter or combination w
D           :math:`(\det C_{ss})^{1/k}`                                 volume of the confidence ellipsoid
A           :math:`\operatorname{tr} C_{ss} / k`                        mean variance
E           :math:`\lambda_{\max}(C_{ss})`                              variance in the worst direction
==========  ==========================================================  ==========================================

References
----------
Atkinson, Donev & Tobias, "Optimum experimental designs, with SAS", Oxford 2007, chapters 10 and 17 (averages over prior
samples); Pronzato & Pázman, "Design of experiments in nonlinear models", Springer 2013, chapter 8 (robust criteria).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.parameters import ParameterSpace

CRITERIA = ("c", "D", "A", "E")
AGGREGATES = ("mean", "worst")

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


@dataclass(frozen=True)
class Criterion:
    """A criterion for learning parameters."""

    name: str
    """One of `CRITERIA`."""
    weights: FloatArray
    """Chosen parameters, shape (k, d): unit rows for D, A and E; one row of weights of relative changes for c."""
    aggregate: str = "mean"
    """Over the parameter samples: ``mean`` of the logarithm, or the ``worst``."""
    #: Whether larger shown values are better.
    larger_is_better: ClassVar[bool] = False

    def __call__(self, precision: FloatArray) -> FloatArray:
        """Logarithm of the criterion, shape (...), from relative precisions (..., N, d, d)."""
        usable = np.asarray(np.isfinite(precision).all(axis=(-2, -1)))
        safe = np.where(usable[..., None, None], precision, np.eye(precision.shape[-1]))
        columns = np.broadcast_to(self.weights.T, (*safe.shape[:-1], len(self.weights)))
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
    names: tuple[str, ...],
    chosen: tuple[str, ...],
    combination: Mapping[str, float] | None = None,
    aggregate: str = "mean",
) -> Criterion:
    """The criterion for chosen parameters among ``names``.

    Parameters
    ----------
    name
        One of `CRITERIA`; ``c`` takes one chosen parameter, or a combination.
    names
        All parameters, in the order of the precision matrices.
    chosen
        Those to be learnt.
    combination
        Weights of relative changes: ``{"d_M": 1, "c_M": -1}`` is the ratio of the two.
    aggregate
        One of `AGGREGATES`.

    Raises
    ------
    InputError
        For unknown names, or a criterion that does not fit what was chosen.
    """
    combination = dict(combination or {})
    issues = [
        Issue(option, f"unknown {what} '{value}'", did_you_mean(value, known))
        for option, what, value, known in (
            ("--criterion", "criterion", name, CRITERIA),
            ("--robust", "aggregate", aggregate, AGGREGATES),
        )
        if value not in known
    ]
    issues += [
        Issue(f"--parameter {parameter}", "the model has no such parameter", did_you_mean(parameter, names))
        for parameter in (*chosen, *combination)
        if parameter not in names
    ]
    raise_errors(issues)
    if name == "c":
        if not combination and len(chosen) != 1:
            raise InputError.of(
                "--criterion c", f"{len(chosen)} parameters chosen", "Name one --parameter, or a --combination"
            )
        combination = combination or {chosen[0]: 1.0}
        return Criterion(name, np.array([[combination.get(own, 0.0) for own in names]]), aggregate)
    if combination:
        raise InputError.of("--combination", f"goes with criterion c, not {name}", "Leave one of them out")
    if not chosen:
        raise InputError.of("--parameter", "no parameter is chosen", "Name at least one")
    return Criterion(name, np.eye(len(names))[[names.index(own) for own in chosen]], aggregate)
