r"""Laws fitted to the estimates of every combination of conditions, with their evidence.

Each combination g was fitted: estimates :math:`\hat z_g` with covariance :math:`C_g`, of the logarithm where a
parameter's scale is logarithmic. Laws with coefficients :math:`\beta` predict :math:`z_g(\beta)`, and

.. math:: \chi^2(\beta) = \sum_g (\hat z_g - z_g(\beta))^T C_g^{-1} (\hat z_g - z_g(\beta))

has the form of an arrow: the work grows linearly with the number of combinations. Laplace's approximation of the
evidence, with uniform priors of widths w over the coefficients, is

.. math:: \ln Z = -\tfrac12 \chi^2 + \tfrac k2 \ln 2\pi - \tfrac12 \ln|H| - \sum_j \ln w_j

A parameter with a value per combination fits its estimates whatever they are, and is integrated out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from mofit._typing import FloatArray
from mofit.models import FORMS, FREE, Law, law_parameters, values_under
from mofit.parameters import Parameter
from mofit.sampling.laplace import PRIOR_PRECISION

#: Gauss-Newton steps, halvings of each, and the gain in chi square below which they end; laws are nearly linear
STEPS, HALVINGS, LEAST_GAIN = 30, 8, 1e-6
#: Logarithms beyond which a law has gone astray: what overflows stays a number.
FARTHEST = 1e3
#: Step of the difference quotients, as a share of a coefficient's range.
_DIFFERENCE = 1e-6

#: form by parameter and condition; a parameter that is free is so under all conditions
Assignment: TypeAlias = Mapping[tuple[str, str], str]


@dataclass(frozen=True)
class CellEstimates:
    """What every combination of conditions says alone, of P parameters in G combinations."""

    parameters: tuple[Parameter, ...]
    """With ranges for the data."""
    conditions: tuple[str, ...]
    units: tuple[str, ...]
    """SI units of the conditions."""
    at: FloatArray
    """Values of the conditions, (G, conditions)."""
    values: FloatArray
    """(G, P), in SI units."""
    covariance: FloatArray
    """(G, P, P), of z."""
    shared: tuple[str, ...] = ()
    """Parameters that all combinations determined together: one value, the same in every row."""
    joint_precision: FloatArray | None = None
    """With shared ones, what each combination adds to the precision of all estimates, (G, P, P)."""
    wide: tuple[str, ...] = ()
    """Parameters with laws of their logarithm to choose from: as far as these change them, free values may lie."""

    @cached_property
    def log(self) -> FloatArray:
        """Which parameters are seen as their logarithms, (P,)."""
        return np.array([one.scale == "log" for one in self.parameters])

    @cached_property
    def z(self) -> FloatArray:
        """(G, P)."""
        return np.where(self.log, np.log(np.where(self.log, self.values, 1.0)), self.values)

    @cached_property
    def precision(self) -> FloatArray:
        """(G, P, P)."""
        if self.joint_precision is not None:
            return self.joint_precision
        return np.asarray(np.linalg.inv(self.covariance), dtype=float)

    @property
    def count(self) -> int:
        """Number of estimates."""
        return len(self.at) * (len(self.parameters) - len(self.shared)) + len(self.shared)

    @cached_property
    def sd(self) -> FloatArray:
        """Standard deviations of the values, (G, P)."""
        sd = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return np.asarray(sd * np.where(self.log, self.values, 1.0))

    def law(self, parameter: str, condition: str, form: str) -> Law:
        """A law over the range of a condition."""
        k = self.conditions.index(condition)
        low, high = float(self.at[:, k].min()), float(self.at[:, k].max())
        return Law(parameter, condition, form, (low + high) / 2, (high - low) / 2, self.units[k])


@dataclass(frozen=True)
class LawFit:
    """Laws fitted to the combinations."""

    forms: Assignment
    laws: tuple[Law, ...]
    values: Mapping[str, float]
    """Of the parameters at the centre and of the coefficients; free ones are left out."""
    chi_square: float
    freedom: int
    """Estimates less coefficients."""
    log_evidence: float

    @property
    def free(self) -> tuple[str, ...]:
        """Parameters with a value per combination."""
        return tuple(dict.fromkeys(name for (name, _), form in self.forms.items() if form == FREE))


def fit_laws(cells: CellEstimates, forms: Assignment, start: Mapping[str, float] | None = None) -> LawFit:
    """Weighted least squares of the laws' coefficients over all combinations.

    Parameters
    ----------
    cells
        The estimates.
    forms
        Law of every parameter over every condition.
    start
        Values that another fit found, by name; where there are none the laws begin constant.
    """
    columns = [_Column.of(cells, k, forms, start or {}) for k in range(len(cells.parameters))]
    kept = [k for k, column in enumerate(columns) if not column.free]
    given = [k for k, column in enumerate(columns) if column.free]
    lawful = [columns[k] for k in kept]
    inverse = np.linalg.inv(np.linalg.inv(cells.precision)[:, kept][:, :, kept]) if given else cells.precision
    precision = np.asarray(inverse, dtype=float)
    if not lawful:
        return LawFit(dict(forms), (), {}, 0.0, 0, -_volume(cells, columns, given))
    beta, hessian, value = _minimised(cells.z[:, kept], precision, lawful)
    widths = np.concatenate([column.widths for column in lawful])
    count = len(widths) + len(given) * len(cells.at)
    evidence = -0.5 * value + 0.5 * count * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(hessian)[1]
    evidence -= np.log(widths).sum() + _volume(cells, [columns[k] for k in given], given)
    values: dict[str, float] = {}
    for column, own in zip(lawful, beta, strict=True):
        values |= column.named(own)
    laws = tuple(law for column in lawful for law in column.laws)
    return LawFit(dict(forms), laws, values, value, cells.count - count, float(evidence))


def _minimised(
    z: FloatArray, precision: FloatArray, columns: Sequence[_Column]
) -> tuple[list[FloatArray], FloatArray, float]:
    """Coefficients of least chi square, its curvature with that of the prior, and its value."""
    beta = [column.start for column in columns]
    prior = np.diag(PRIOR_PRECISION / np.concatenate([column.widths for column in columns]) ** 2)
    slope, rest = _linearised(z, columns, beta)
    value = _chi_square(precision, rest)
    hessian = _curvature(precision, slope) + prior
    for _ in range(STEPS):
        step = np.linalg.solve(hessian, np.einsum("gpk,gpq,gq->k", slope, precision, rest, optimize=True))
        for share in 0.5 ** np.arange(HALVINGS):
            moved = _moved(columns, beta, share * step)
            new = _chi_square(precision, z - _predicted(columns, moved))
            if new < value:
                break
        else:
            break
        gain, beta, value = value - new, moved, new
        slope, rest = _linearised(z, columns, beta)
        hessian = _curvature(precision, slope) + prior
        if gain < LEAST_GAIN:
            break
    return beta, hessian, value


def _volume(cells: CellEstimates, columns: Sequence[_Column], given: Sequence[int]) -> float:
    """What integrating over the values of free parameters takes from the log evidence, but for the powers of 2 pi."""
    if not columns:
        return 0.0
    inner = cells.precision[:, given][:, :, given]
    widths = np.stack([column.widths for column in columns], axis=1)  # (G, free)
    inner = inner + np.eye(len(given)) * (PRIOR_PRECISION / widths**2)[:, None]
    return float(0.5 * np.linalg.slogdet(inner)[1].sum() + np.log(widths).sum())


def _moved(columns: Sequence[_Column], beta: Sequence[FloatArray], step: FloatArray) -> list[FloatArray]:
    ends = np.cumsum([len(own) for own in beta])[:-1]
    parts = np.split(step, ends)
    return [column.inside(own + part) for column, own, part in zip(columns, beta, parts, strict=True)]


def _predicted(columns: Sequence[_Column], beta: Sequence[FloatArray]) -> FloatArray:
    return np.stack([column.predicted(own) for column, own in zip(columns, beta, strict=True)], axis=1)


def _linearised(z: FloatArray, columns: Sequence[_Column], beta: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the predicted z (G, P, K), and what the estimates exceed them by (G, P)."""
    slope, rest, at = np.zeros((*z.shape, sum(len(own) for own in beta))), z.copy(), 0
    for k, (column, own) in enumerate(zip(columns, beta, strict=True)):
        steps = _DIFFERENCE * column.widths
        here, *there = column.predicted(np.vstack([own, own + np.diag(steps)]))
        slope[:, k, at : at + len(own)] = ((np.array(there) - here) / steps[:, None]).T
        rest[:, k] -= here
        at += len(own)
    return slope, rest


def _curvature(precision: FloatArray, slope: FloatArray) -> FloatArray:
    weighted = precision @ slope
    return np.asarray(np.tensordot(slope, weighted, axes=((0, 1), (0, 1))))


def _chi_square(precision: FloatArray, rest: FloatArray) -> float:
    value = float(np.sum(rest * (precision @ rest[..., None])[..., 0]))
    return value if np.isfinite(value) else np.inf


@dataclass(frozen=True)
class _Column:
    """One parameter with its laws: its z in all combinations from the coefficients, the first its z at the centre."""

    parameter: Parameter
    laws: tuple[Law, ...]
    conditions: Mapping[str, FloatArray]
    coefficients: tuple[Parameter, ...]
    start: FloatArray
    widths: FloatArray
    """Of the ranges; one per combination where the parameter is free."""
    free: bool

    @classmethod
    def of(cls, cells: CellEstimates, k: int, forms: Assignment, start: Mapping[str, float]) -> _Column:
        one, log = cells.parameters[k], cells.parameters[k].scale == "log"
        own = {condition: form for (name, condition), form in forms.items() if name == one.name}
        width = float(np.log(one.upper / one.lower)) if log else one.upper - one.lower
        conditions = {name: cells.at[:, j] for j, name in enumerate(cells.conditions)}
        if FREE in own.values():
            # the first as the value at the centre, the others as what a law changes
            change = 2.0 if log and one.name not in cells.wide else width
            widths = np.array([width, *[change] * (len(cells.at) - 1)])
            return cls(one, (), conditions, (), np.empty(0), widths, True)
        laws = tuple(cells.law(one.name, q, form) for q, form in own.items() if form in FORMS)
        added = tuple(p for law in laws for p in law_parameters(law, one))
        value = start.get(one.name)
        centre = float(np.mean(cells.z[:, k])) if value is None else float(np.log(value) if log else value)
        begin = np.array([centre, *(start.get(p.name, p.nominal) for p in added)])
        widths = np.array([width, *(p.upper - p.lower for p in added)])
        return cls(one, laws, conditions, added, begin, widths, False)

    def predicted(self, beta: FloatArray) -> FloatArray:
        """The parameter in all combinations as its z, (..., G), from coefficients (..., k)."""
        own = {one.name: beta[..., k, None] for k, one in enumerate(self.coefficients, 1)}
        centre, log = beta[..., 0, None], self.parameter.scale == "log"
        with np.errstate(divide="ignore", over="ignore"):
            own[self.parameter.name] = np.exp(centre) if log else centre
            values = values_under(self.parameter, self.laws, own, self.conditions)
            if not self.laws:
                values = values + np.zeros(len(next(iter(self.conditions.values()))))
            return np.asarray(np.clip(np.log(values), -FARTHEST, FARTHEST) if log else values)

    def named(self, beta: FloatArray) -> dict[str, float]:
        """The value at the centre and the coefficients."""
        with np.errstate(over="ignore"):
            centre = float(np.exp(beta[0]) if self.parameter.scale == "log" else beta[0])
        names = (one.name for one in self.coefficients)
        return {self.parameter.name: centre, **dict(zip(names, beta[1:].tolist(), strict=True))}

    def inside(self, beta: FloatArray) -> FloatArray:
        """The coefficients within their limits."""
        limits = np.array([one.possible for one in self.coefficients]).reshape(-1, 2)
        return np.concatenate([beta[:1], np.clip(beta[1:], limits[:, 0], limits[:, 1])])
