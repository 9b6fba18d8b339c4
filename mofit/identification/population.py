r"""Specimens: mean and spread of each parameter over them, and the ones that stand out.

With the estimates :math:`\hat z_g` of specimen g alone (of the logarithm where the scale is logarithmic) and their
variances :math:`C_g`, a normal population of mean :math:`\mu` and spread :math:`\tau` has the density

.. math:: p(\hat z \mid \mu, \tau) = \prod_g N(\hat z_g; \mu, C_g + \tau^2)

with :math:`\mu` uniform over the parameter's range and :math:`\ln \tau` uniform over the range of spreads
(`mofit.problem.pooling`). Against it stands a value that all specimens share, :math:`\tau = 0`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtri, stdtr

from mofit._typing import FloatArray
from mofit.identification.law_fit import CellEstimates, LawFit, fit_laws
from mofit.models import CONSTANT, FREE
from mofit.parameters import ParameterSpace
from mofit.problem.pooling import hyperparameters, mean_name, spread_name

#: the law of a parameter whose values are drawn from a population
POOLED = "pooled"
#: Probability of naming any specimen where none stands out.
FALSE_ALARM = 0.01
#: Spreads that the integral runs over.
_SPREADS = 200
#: Specimens without which no spread can be told from the others.
FEWEST = 3


@dataclass(frozen=True)
class Population:
    """One parameter over the specimens; spread and its quantiles are of z."""

    parameter: str
    mean: float
    """In SI units."""
    mean_band: tuple[float, float]
    spread: float
    spread_band: tuple[float, float]
    """5 % and 95 % quantiles."""
    log_evidence: float
    """Of a population, relative to one value for all."""


@dataclass(frozen=True)
class Outlier:
    """A specimen that stands out."""

    specimen: int
    """Its row among the specimens."""
    parameter: str
    z: float
    """Distance from what the others predict, in standard deviations of the prediction."""
    p_value: float
    """Two-sided, times the number of comparisons."""


def populations(cells: CellEstimates, without: Sequence[Outlier] = ()) -> tuple[Population, ...]:
    """The population of every parameter, from the estimates of every specimen but those that stand out by it."""
    variances, found = np.diagonal(cells.covariance, axis1=1, axis2=2), []
    for k, one in enumerate(cells.parameters):
        kept = np.delete(np.arange(len(cells.at)), [odd.specimen for odd in without if odd.parameter == one.name])
        found.append(_population(cells, k, cells.z[kept, k], variances[kept, k]))
    return tuple(found)


def _population(cells: CellEstimates, k: int, z: FloatArray, variance: FloatArray) -> Population:
    one, log = cells.parameters[k], bool(cells.log[k])
    _, spread = hyperparameters(ParameterSpace((one.scoped("test", True),)))
    grid = np.geomspace(spread.lower, spread.upper, _SPREADS)
    value, mean, sd = (np.array(part) for part in zip(*(_given(z, variance, tau) for tau in grid), strict=True))
    weights = np.exp(value - logsumexp(value))
    low, middle, high = grid[np.searchsorted(np.cumsum(weights), [0.05, 0.5, 0.95])]
    whole = np.sqrt(weights @ (sd**2 + mean**2) - (weights @ mean) ** 2)
    centre, half = float(weights @ mean), float(ndtri(0.95) * whole)
    ends = [centre - half, centre, centre + half]
    first, best, last = (float(value) for value in (np.exp(ends) if log else ends))
    evidence = logsumexp(value) - np.log(_SPREADS) - _given(z, variance, 0.0)[0]
    return Population(one.name, best, (first, last), float(middle), (float(low), float(high)), float(evidence))


def _given(z: FloatArray, variance: FloatArray, tau: float) -> tuple[float, float, float]:
    """Log density with the mean integrated out, up to the log of its range; mean and its standard deviation."""
    weight = 1 / (variance + tau**2)
    mean = float(weight @ z / weight.sum())
    value = 0.5 * np.log(weight).sum() - 0.5 * np.log(weight.sum()) - 0.5 * weight @ (z - mean) ** 2
    return float(value), mean, float(weight.sum() ** -0.5)


def outliers(cells: CellEstimates) -> tuple[Outlier, ...]:
    """Specimens that the others do not predict, the farthest first.

    Those without it give mean and spread of the population, hence a Student t distribution of its estimate; the limit
    is `FALSE_ALARM` over all parameters and specimens (Bonferroni).
    """
    variances = np.diagonal(cells.covariance, axis1=1, axis2=2)
    count, found = len(cells.at), []
    for k, one in enumerate(cells.parameters):
        for g in range(count if count > FEWEST else 0):
            rest = np.delete(np.arange(count), g)
            z, spread = _distance(cells.z[rest, k], variances[rest, k], cells.z[g, k], variances[g, k])
            p = 2 * stdtr(len(rest) - 1, -abs(z)) * count * len(cells.parameters)
            if spread > 0 and p < FALSE_ALARM:
                found.append(Outlier(g, one.name, float(z), float(p)))
    return tuple(sorted(found, key=lambda one: one.p_value))


def _distance(others: FloatArray, variances: FloatArray, own: float, variance: float) -> tuple[float, float]:
    """Distance of a value from that predicted, in standard deviations, and that standard deviation."""
    scatter = float(others.var(ddof=1))
    between = max(scatter - float(variances.mean()), 0.0)
    # the values scatter by less than their variances only by chance: these count then
    mean_variance = (between + float(variances.mean())) / len(others)
    sd = float(np.sqrt(between + variance + mean_variance))
    return (own - float(others.mean())) / sd, sd


def choose_populations(
    cells: CellEstimates, said: Mapping[str, str]
) -> tuple[LawFit, dict[tuple[str, str], dict[str, float]]]:
    """Which parameters have a population, as said or by evidence, and the evidence for it.

    The fit holds the values that all specimens share, and means and spreads of the others.
    """
    (condition,) = cells.conditions
    found = {one.parameter: one for one in populations(cells)}
    evidence, forms = {}, {}
    values: dict[str, float] = {}
    for one in cells.parameters:
        gain = found[one.name].log_evidence
        form = said.get(one.name) or (POOLED if gain > 0 else CONSTANT)
        other = {CONSTANT: 0.0, POOLED: gain}
        evidence[one.name, condition] = {key: value - other[form] for key, value in other.items()}
        forms[one.name, condition] = form
        if form == POOLED:
            population = found[one.name]
            values |= {mean_name(one.name): population.mean, spread_name(one.name): population.spread}
    shared = fit_laws(cells, {key: FREE if form == POOLED else form for key, form in forms.items()})
    fit = LawFit(forms, (), {**shared.values, **values}, shared.chi_square, shared.freedom, shared.log_evidence)
    return fit, evidence
