r"""What makes a design good: one number from the information matrix, smaller is better.

All criteria look at the covariance :math:`C = M^{-1}` of *relative* changes (`Scale`), of the chosen parameters only,
the others being nuisances:

==========  ==========================================================  ==========================================
criterion   value                                                       asks for
==========  ==========================================================  ==========================================
c           :math:`w^T C w`                                             one parameter, or one combination of them
D           :math:`(\det C_{ss})^{1/k}`                                 a small confidence ellipsoid
A           :math:`\operatorname{tr} C_{ss} / k`                        small variances on average
E           :math:`\lambda_{\max}(C_{ss})`                              no direction left open
==========  ==========================================================  ==========================================

References
----------
Atkinson, Donev & Tobias, "Optimum experimental designs, with SAS", Oxford 2007, chapters 10 and 17 (averages over prior
points); Pronzato & Pázman, "Design of experiments in nonlinear models", Springer 2013, chapter 8 (robust criteria).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.parameters import ParameterSpace

Array = NDArray[np.float64]

CRITERIA = ("c", "D", "A", "E")
AGGREGATES = ("mean", "worst")

#: A parameter at (almost) zero changes relative to this share of its box instead.
_LEAST_SHARE = 0.01


def scales(space: ParameterSpace, values: Array) -> Array:
    """By what a change of each parameter is divided to be a relative one, shape (N, d), from values (N, d).

    The magnitude of the value, but at least a hundredth of the width of a linear parameter's box.
    """
    linear = np.array([parameter.scale == "linear" for parameter in space.parameters])
    least = np.where(linear, _LEAST_SHARE * (space.upper - space.lower), 0.0)
    return np.maximum(np.abs(values), least)


def box_precision(space: ParameterSpace, values: Array) -> Array:
    """What the bounds alone say, shape (N, d, d): that of a uniform spread over the box, in natural units."""
    spread = space.slope(values) / np.sqrt(12.0)
    return np.asarray(np.eye(len(space)) / spread[..., None, :] ** 2)


@dataclass(frozen=True)
class Goal:
    """What is minimised.

    Parameters
    ----------
    criterion
        One of `CRITERIA`.
    weights
        Chosen parameters, shape (k, d): unit rows for D, A and E; one row of weights of relative changes for c.
    aggregate
        Over the parameter points: ``mean`` of the logarithm, or the ``worst``.
    """

    criterion: str
    weights: Array
    aggregate: str = "mean"

    def at_points(self, information: Array) -> Array:
        """Logarithm of the criterion, shape (..., N), from relative information (..., N, d, d).

        nan where the information is not finite.
        """
        usable = np.asarray(np.isfinite(information).all(axis=(-2, -1)))
        safe = np.where(usable[..., None, None], information, np.eye(information.shape[-1]))
        columns = np.broadcast_to(self.weights.T, (*safe.shape[:-1], len(self.weights)))
        covariance = self.weights @ np.linalg.solve(safe, columns)
        return np.asarray(np.where(usable, _log_value(self.criterion, covariance), np.nan))

    def __call__(self, information: Array) -> Array:
        """The same over all points, shape (...); infinite where no point can be evaluated."""
        values = self.at_points(information)
        whole = np.isfinite(values).all(axis=-1)
        safe = np.where(np.isfinite(values), values, 0.0)
        reduced = safe.mean(axis=-1) if self.aggregate == "mean" else safe.max(axis=-1)
        return np.asarray(np.where(whole, reduced, np.inf))


def _log_value(criterion: str, covariance: Array) -> Array:
    covariance = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
    tiny = np.finfo(float).tiny
    if criterion == "D":
        sign, value = np.linalg.slogdet(covariance)
        return np.asarray(np.where(sign > 0, value, -np.inf) / covariance.shape[-1])
    if criterion == "E":
        return np.asarray(np.log(np.maximum(np.linalg.eigvalsh(covariance)[..., -1], tiny)))
    return np.asarray(np.log(np.maximum(np.trace(covariance, axis1=-2, axis2=-1) / covariance.shape[-1], tiny)))


def goal(
    criterion: str,
    names: tuple[str, ...],
    chosen: tuple[str, ...],
    combination: Mapping[str, float] | None = None,
    aggregate: str = "mean",
) -> Goal:
    """The goal for chosen parameters among ``names``.

    Parameters
    ----------
    criterion
        One of `CRITERIA`; ``c`` takes one chosen parameter, or a combination.
    names
        All parameters, in the order of the information matrices.
    chosen
        Those that matter.
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
    faults = [
        Fault(option, f"unknown {what} '{value}'", did_you_mean(value, known))
        for option, what, value, known in (
            ("--criterion", "criterion", criterion, CRITERIA),
            ("--robust", "way", aggregate, AGGREGATES),
        )
        if value not in known
    ]
    faults += [
        Fault(f"--parameter {name}", "the model has no such parameter", did_you_mean(name, names))
        for name in (*chosen, *combination)
        if name not in names
    ]
    raise_errors(faults)
    if criterion == "c":
        if not combination and len(chosen) != 1:
            raise InputError.of(
                "--criterion c", f"{len(chosen)} parameters chosen", "Name one --parameter, or a --combination"
            )
        combination = combination or {chosen[0]: 1.0}
        return Goal(criterion, np.array([[combination.get(name, 0.0) for name in names]]), aggregate)
    if combination:
        raise InputError.of("--combination", f"goes with criterion c, not {criterion}", "Leave one of them out")
    if not chosen:
        raise InputError.of("--parameter", "no parameter is chosen", "Name at least one")
    return Goal(criterion, np.eye(len(names))[[names.index(name) for name in chosen]], aggregate)
