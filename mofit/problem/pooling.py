r"""Pooled parameters: their values in tests or under conditions are drawn from a normal, which is estimated along.

With the values :math:`\hat z_g` that are best for group g alone and their covariance :math:`C_g` (Laplace; exact where
they enter linearly), integrating over the true ones leaves

.. math:: -\log p = \sum_g \tfrac12 \log\det V_g + \tfrac12 (\hat z_g - \mu)^T V_g^{-1} (\hat z_g - \mu), \qquad
          V_g = C_g + \operatorname{diag}(\tau^2)

with mean :math:`\mu` and spread :math:`\tau`, which are free parameters. z is the value, or its logarithm where the
parameter's scale is logarithmic. Around a point z changes linearly with the free parameters, and C is that there.

References
----------
Lindstrom and Bates, "Nonlinear mixed effects models for repeated measures data", Biometrics 46 (1990).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.parameters import PER_CAMPAIGN, Parameter, ParameterSpace
from mofit.simulation.scoped_simulator import ScopedSimulator
from mofit.simulation.scopes import Unknowns

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
    """The normals of the pooled parameters, with what the data say of each value around a point of the free ones."""

    own: ParameterSpace
    """The scoped parameters, L."""
    unknowns: Unknowns
    z: FloatArray
    """Best values z of every group at the point, (G, m)."""
    covariance: FloatArray
    """C of every group, (G, m, m); places of values that are not pooled are not read."""
    point: FloatArray
    """In unit coordinates, (d,)."""
    slopes: FloatArray
    """Derivatives of z by the unit coordinates, (G, m, d)."""

    @classmethod
    def of(
        cls, simulator: ScopedSimulator, p: FloatArray, covariance: FloatArray, space: ParameterSpace, point: FloatArray
    ) -> Pooling:
        """Around a point (d,) whose set is p (1, np); covariance (G, m, m) in unit coordinates of the scoped values."""
        own, best, count = simulator.scopes.space, simulator.best(p), len(simulator.free)
        test, which = best.unknowns.first_test, best.unknowns.parameter
        by_test = best.values[0][:, simulator.columns]
        values, width = by_test[test, which], own.derivative(by_test)[test, which]
        log = np.array([one.scale == "log" for one in own.parameters])[which]
        rate = 1 / np.where(log, values, 1.0)  # d z / d value
        slopes = np.zeros((*values.shape, len(space)))
        free = space.derivative(space.from_unit(point))[:count]
        slopes[..., :count] = simulator.slopes(p)[0, test, which] * rate[..., None] * free
        unit = width * rate
        return cls(
            own=own,
            unknowns=best.unknowns,
            z=np.where(log, np.log(np.where(log, values, 1.0)), values),
            covariance=covariance * unit[:, :, None] * unit[:, None, :],
            point=point,
            slopes=slopes,
        )

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which places are pooled, (G, m)."""
        return self.unknowns.used & np.array([one.pooled for one in self.own.parameters])[self.unknowns.parameter]

    def terms(self, space: ParameterSpace, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """-log p (N,), gradient (N, d) and Gauss-Newton Hessian (N, d, d) at points u (N, d)."""
        values = space.from_unit(u)
        slope = space.derivative(values)
        mean, spread, rate = self._normals(space, values)
        mask, which = self.mask, self.unknowns.parameter
        z = self.z + np.einsum("gmd,nd->ngm", self.slopes, u - self.point)
        rest = np.where(mask, z - mean[:, which], 0.0)  # (N, G, m)
        jacobian = np.tile(self.slopes, (len(u), 1, 1, 1))
        scatter = np.where(mask[:, :, None] & mask[:, None, :], self.covariance, 0.0)
        width = np.zeros_like(jacobian)  # d V_ii / d u
        most = np.arange(rest.shape[-1])
        total = np.tile(scatter, (len(u), 1, 1, 1))
        total[..., most, most] += np.where(mask, spread[:, which] ** 2, 1.0)
        for column, parameter in enumerate(self.own.parameters):
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

    def shrunk(self, space: ParameterSpace) -> tuple[FloatArray, FloatArray]:
        """Scoped values and their standard deviations given the normals at the point, in SI units, (G, m) each.

        Each is drawn towards the mean as far as it is less certain than the spread.
        """
        mean, spread, _ = self._normals(space, space.from_unit(self.point[None]))
        which, used = self.unknowns.parameter, self.unknowns.used
        data = np.where(used[:, :, None] & used[:, None, :], self.covariance, 0.0)
        most = np.arange(used.shape[1])
        data[:, most, most] += np.where(used, 0.0, 1.0)
        precision = np.linalg.inv(data)
        drawn = np.where(self.mask, 1 / spread[0][which] ** 2, 0.0)
        total = precision.copy()
        total[:, most, most] += drawn
        covariance = np.linalg.inv(total)
        towards = np.einsum("gij,gj->gi", precision, self.z) + drawn * mean[0][which]
        z, sd = np.einsum("gij,gj->gi", covariance, towards), np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        log = np.array([one.scale == "log" for one in self.own.parameters])[which]
        values = np.where(log, np.exp(np.where(log, z, 0.0)), z)
        return values, sd * np.where(log, values, 1.0)

    def _normals(self, space: ParameterSpace, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean in z, spread and d mean / d value of every scoped parameter, (N, L) each."""
        mean, spread = np.zeros((len(values), len(self.own))), np.ones((len(values), len(self.own)))
        rate = np.ones_like(mean)
        for column, one in enumerate(self.own.parameters):
            if one.pooled:
                centre = values[:, space.index(mean_name(one.name))]
                spread[:, column] = values[:, space.index(spread_name(one.name))]
                mean[:, column] = np.log(centre) if one.scale == "log" else centre
                rate[:, column] = 1 / centre if one.scale == "log" else 1.0
        return mean, spread, rate
