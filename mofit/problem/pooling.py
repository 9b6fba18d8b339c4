r"""Pooled parameters: their values in tests or under conditions are drawn from a normal, which is estimated along.

With the values :math:`\hat z_g` that are best for group g alone and their covariance :math:`C_g` (Laplace; exact where
they enter linearly), integrating over the true ones leaves

.. math:: -\log p = \sum_g \tfrac12 \log\det V_g + \tfrac12 (\hat z_g - \mu)^T V_g^{-1} (\hat z_g - \mu), \qquad
          V_g = C_g + \operatorname{diag}(\tau^2)

with mean :math:`\mu` and spread :math:`\tau`, which are free parameters. z is the value, or its logarithm where the
parameter's scale is logarithmic.

References
----------
Lindstrom and Bates, "Nonlinear mixed effects models for repeated measures data", Biometrics 46 (1990).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import PER_CAMPAIGN, Parameter, ParameterSpace
from mofit.simulation.scoped_simulator import Best, ScopedSimulator

#: smallest spread that is searched, as a share of the range of the values
_LEAST = 1e-4


def mean_name(name: str) -> str:
    """Name of the mean of a pooled parameter."""
    return f"{name}_mean"


def spread_name(name: str) -> str:
    """Name of its spread: a standard deviation; of the logarithm where the scale is logarithmic."""
    return f"{name}_spread"


def hyperparameters(space: ParameterSpace) -> tuple[Parameter, ...]:
    """Mean and spread of every pooled parameter of a space, in its ranges."""
    found = []
    for one in space.parameters:
        if one.pooled:
            log = one.scale == "log"
            width = float(np.log(one.upper / one.lower)) if log else one.upper - one.lower
            unit, about = "1" if log else one.unit, one.description or one.name
            found += [
                replace(one, name=mean_name(one.name), description=f"mean of {about}", per=PER_CAMPAIGN, pooled=False),
                Parameter(spread_name(one.name), unit, _LEAST * width, width, 0.1 * width, "log", f"spread of {about}"),
            ]
    return tuple(found)


@dataclass(frozen=True)
class Pooling:
    """The normals of the pooled parameters."""

    covariance: FloatArray
    """C of every group in z, (G, m, m); places of values that are not pooled are not read."""

    @classmethod
    def of(cls, covariance: FloatArray, simulator: ScopedSimulator, best: Best) -> Pooling:
        """From the covariance of the scoped values in unit coordinates, (G, m, m), at the first set of ``best``."""
        own, unknowns = simulator.scopes.space, best.unknowns
        values = best.values[0][unknowns.first_test, simulator.columns[unknowns.parameter]]
        log = np.array([one.scale == "log" for one in own.parameters])[unknowns.parameter]
        by_test = own.derivative(best.values[0][:, simulator.columns])
        width = by_test[unknowns.first_test, unknowns.parameter] / np.where(log, values, 1.0)
        return cls(covariance * width[:, :, None] * width[:, None, :])

    def terms(
        self, simulator: ScopedSimulator, p: FloatArray, space: ParameterSpace, u: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """-log p (N,), gradient (N, d) and Gauss-Newton Hessian (N, d, d) at points u (N, d), sets p (N, np)."""
        own, unknowns = simulator.scopes.space, simulator.best(p).unknowns
        values = space.from_unit(u)
        slope = space.derivative(values)
        mean, spread, rate = self._normals(own, space, values)
        pooled = np.array([one.pooled for one in own.parameters])
        mask, which = unknowns.used & pooled[unknowns.parameter], unknowns.parameter
        z, dz = scaled_values(simulator, p)
        rest = np.where(mask, z - mean[:, which], 0.0)  # (N, G, m)
        jacobian = np.zeros((*rest.shape, len(space)))
        jacobian[..., : dz.shape[-1]] = dz * slope[:, None, None, : dz.shape[-1]]
        scatter = np.where(mask[:, :, None] & mask[:, None, :], self.covariance, 0.0)
        width = np.zeros_like(jacobian)  # d V_ii / d u
        most = np.arange(rest.shape[-1])
        total = np.tile(scatter, (len(u), 1, 1, 1))
        total[..., most, most] += np.where(mask, spread[:, which] ** 2, 1.0)
        for column, parameter in enumerate(own.parameters):
            if parameter.pooled:
                at = mask & (which == column)
                first, second = space.index(mean_name(parameter.name)), space.index(spread_name(parameter.name))
                jacobian[:, at, first] = -(rate[:, column] * slope[:, first])[:, None]
                width[:, at, second] = (2 * spread[:, column] * slope[:, second])[:, None]
        jacobian[:, ~mask] = 0.0
        inverse = np.linalg.inv(total)
        weighted = np.einsum("ngij,ngj->ngi", inverse, rest)
        value = 0.5 * np.sum(np.linalg.slogdet(total)[1], axis=1) + 0.5 * np.einsum("ngi,ngi->n", rest, weighted)
        diagonal = np.diagonal(inverse, axis1=-2, axis2=-1)
        gradient = np.einsum("ngid,ngi->nd", jacobian, weighted)
        gradient += 0.5 * np.einsum("ngid,ngi->nd", width, diagonal - weighted**2)
        hessian = np.einsum("ngia,ngij,ngjb->nab", jacobian, inverse, jacobian)
        hessian += 0.5 * np.einsum("ngia,ngij,ngjb->nab", width, inverse**2, width)
        return value, gradient, hessian

    def shrunk(
        self, simulator: ScopedSimulator, p: FloatArray, space: ParameterSpace, u: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Scoped values z and their variances given the normals, (G, m) each, at one point u (1, d), set p (1, np).

        Each is drawn towards the mean as far as it is less certain than the spread.
        """
        own, unknowns = simulator.scopes.space, simulator.best(p).unknowns
        mean, spread, _ = self._normals(own, space, space.from_unit(u))
        which = unknowns.parameter
        mask = unknowns.used & np.array([one.pooled for one in own.parameters])[which]
        used = unknowns.used[:, :, None] & unknowns.used[:, None, :]
        own_precision = np.linalg.inv(np.where(used, self.covariance, 0.0) + 1e-300 * np.eye(mask.shape[1]))
        drawn = np.where(mask, 1 / spread[0][which] ** 2, 0.0)
        most = np.arange(mask.shape[1])
        total = own_precision.copy()
        total[:, most, most] += drawn
        covariance = np.linalg.inv(total)
        z = scaled_values(simulator, p)[0][0]
        towards = np.einsum("gij,gj->gi", own_precision, z) + drawn * mean[0][which]
        return np.einsum("gij,gj->gi", covariance, towards), np.diagonal(covariance, axis1=1, axis2=2)

    @staticmethod
    def _normals(
        own: ParameterSpace, space: ParameterSpace, values: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean in z, spread and d mean / d value of every scoped parameter, (N, L) each."""
        mean, spread = np.zeros((len(values), len(own))), np.ones((len(values), len(own)))
        rate = np.ones_like(mean)
        for column, one in enumerate(own.parameters):
            if one.pooled:
                centre = values[:, space.index(mean_name(one.name))]
                spread[:, column] = values[:, space.index(spread_name(one.name))]
                mean[:, column] = np.log(centre) if one.scale == "log" else centre
                rate[:, column] = 1 / centre if one.scale == "log" else 1.0
        return mean, spread, rate


def scaled_values(simulator: ScopedSimulator, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The scoped values z (N, G, m) at sets p (N, np), and their derivatives by the free ones (N, G, m, nf)."""
    best = simulator.best(p)
    test, which = best.unknowns.first_test, best.unknowns.parameter
    values = best.values[:, test, simulator.columns[which]]
    slopes = simulator.slopes(p)[:, test, which]
    log = np.array([one.scale == "log" for one in simulator.scopes.space.parameters])[which]
    return np.where(log, np.log(np.where(log, values, 1.0)), values), slopes / np.where(log, values, 1.0)[..., None]
