"""The one hand-over object: a model, the tests it is held against, what is free, and what the noise is like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Measurement
from mofit.drives import first_input, require, to_drive
from mofit.kernel import Drive, Simulator
from mofit.model import Model, System, build_system
from mofit.objectives import (
    GaussianPrior,
    Noise,
    TestSums,
    effective_samples,
    likelihood_terms,
    negative_log_likelihood,
    nrmsd,
)
from mofit.parameters import ParameterSpace
from mofit.signals import Record, analyse

Array = NDArray[np.float64]

#: Integration error that is allowed, relative to the output's range. Anywhere in the box: 1e-4 adds at most 1e-6 to an
#: NRMSD of 5e-3. Near a mode: a share of the noise and gap there; on the paper's rig 3e-5, which is 0.1 N where the
#: noise of a harmonic is about 0.6 N.
TOLERANCE = 1e-4
NOISE_SHARE = 5e-3
TIGHTEST = 1e-6
#: Standard deviations around a mode that a sampler visits.
REACH = 12.0


@dataclass(frozen=True)
class Problem:
    """Search, refinement, sampling and diagnosis all read this.

    Points are given in the unit cube of ``space``, batched: ``u`` has shape (N, d). A point outside the cube or whose
    simulation fails has objective nan and log posterior -inf.

    Attributes
    ----------
    model, system
        The model and its vector form.
    measurements, records
        The tests used, and what their signals say (period, transient, noise).
    space
        The free parameters.
    fixed
        Values of the others.
    simulator
        The compiled model, driven by the tests.
    drives
        The tests as the kernel sees them.
    noise
        Counted and independent residuals per test.
    prior
        What earlier stages know of some free parameters.
    """

    model: Model
    system: System
    measurements: tuple[Measurement, ...]
    records: tuple[Record, ...]
    space: ParameterSpace
    fixed: Mapping[str, float]
    simulator: Simulator
    drives: tuple[Drive, ...]
    noise: Noise
    prior: GaussianPrior | None = None

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests: one objective each."""
        return tuple(measurement.name for measurement in self.measurements)

    @cached_property
    def _prior_terms(self) -> tuple[Array, Array]:
        if self.prior is None:
            return np.full(len(self.space), 0.5), np.zeros((len(self.space), len(self.space)))
        return self.prior.spread_over(self.space.names)

    def full(self, u: Array) -> Array:
        """Values of all the system's parameters, shape (N, p), from points u (N, d)."""
        values = self.space.from_unit(u)
        columns = [
            values[:, self.space.index(name)] if name in self.space.names else np.full(len(u), self.fixed[name])
            for name in self.system.parameters
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((len(u), 0))

    def objectives(self, u: Array) -> Array:
        """NRMSD per test (eq. 10), shape (N, tests)."""
        values = nrmsd(self.simulator.cost(self.full(u)), self.noise.count)
        return np.where(np.isfinite(values), values, np.nan)

    def sums(self, u: Array) -> TestSums:
        """Cost, gradient and Gauss-Newton matrix per test, in unit coordinates."""
        values = self.full(u)
        cost, gradient, normal = self.simulator.gauss_newton(values)
        slope = self.space.slope(self.space.from_unit(u))
        return TestSums(
            cost=cost,
            gradient=gradient * slope[:, None, :],
            normal=normal * slope[:, None, :, None] * slope[:, None, None, :],
        )

    def gradients(self, u: Array) -> tuple[Array, Array]:
        r"""NRMSD per test (N, T) and its gradient :math:`J_t^T W r_t / (n_t \mathrm{NRMSD}_t)`, (N, T, d)."""
        sums = self.sums(u)
        values = nrmsd(sums.cost, self.noise.count)
        values = np.where(np.isfinite(values), values, np.nan)
        scale = np.maximum(self.noise.count * values, np.finfo(float).tiny)
        return values, sums.gradient / scale[..., None]

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        value, gradient, hessian = likelihood_terms(self.sums(u), self.noise)
        mean, precision = self._prior_terms
        offset = u - mean
        pull = offset @ precision
        return value + 0.5 * np.sum(pull * offset, axis=1), gradient + pull, hessian + precision

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density in the unit cube up to a constant, shape (N,); -inf outside or where it fails."""
        result = np.full(len(u), -np.inf)
        inside = np.all((u >= 0) & (u <= 1), axis=1)
        if not inside.any():
            return result
        points = u[inside]
        value = negative_log_likelihood(self.simulator.cost(self.full(points)), self.noise) + self.prior_value(points)
        result[inside] = np.where(np.isfinite(value), -value, -np.inf)
        return result

    def squares(self, u: Array) -> Array:
        """Weighted sum of all tests' squares, shape (N,), as the likelihood sees them."""
        return np.asarray(self.simulator.cost(self.full(u)) @ self.noise.weights)

    def squares_terms(self, u: Array) -> tuple[Array, Array, Array]:
        """The same with gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        sums, weights = self.sums(u), self.noise.weights
        return (
            np.asarray(sums.cost @ weights),
            2 * np.einsum("t,ntd->nd", weights, sums.gradient),
            2 * np.einsum("t,ntde->nde", weights, sums.normal),
        )

    @property
    def prior_precision(self) -> Array:
        """Of the Gaussian prior, shape (d, d)."""
        return self._prior_terms[1]

    def prior_value(self, u: Array) -> Array:
        """Negative log density of the Gaussian prior up to a constant, shape (N,)."""
        mean, precision = self._prior_terms
        return np.asarray(0.5 * np.einsum("ni,ij,nj->n", u - mean, precision, u - mean))

    def prior_gradient(self, u: Array) -> Array:
        """Gradient of `prior_value`, shape (N, d)."""
        mean, precision = self._prior_terms
        return np.asarray((u - mean) @ precision)

    def simulate(self, u: Array) -> list[Array]:
        """Simulated outputs per test, shape (N, samples, outputs)."""
        return self.simulator.simulate(self.full(u))

    def with_noise_at(self, u: Array) -> Problem:
        """The problem with its noise as seen at one point u (d,)."""
        independent = []
        for drive, output in zip(self.drives, self.simulate(u[None]), strict=True):
            used = drive.weights[:, 0] > 0
            columns = (output[0] - drive.measured)[used].T
            independent.append(sum(effective_samples(column) for column in columns))
        return replace(self, noise=self.noise.at(self.objectives(u[None])[0], np.array(independent)))

    def with_noise(self, noise: Noise) -> Problem:
        """The problem with another view of its noise."""
        return replace(self, noise=noise)

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The problem with other values of parameters that are not free; those of free ones are ignored."""
        known = {name: float(values.get(name, value)) for name, value in self.fixed.items()}
        return replace(self, fixed=known)

    def near(self, points: Array, spread: Array) -> Problem:
        """The same problem, integrated for the neighbourhood of points (K, d) with standard deviations (d,) only.

        The number of integration steps need not cover the stiffest corner of the whole box then.
        """
        reach = REACH * spread
        corners = np.clip([points.min(axis=0) - reach, points.max(axis=0) + reach], 0.0, 1.0)
        box = _box(self.system, self.space, self.fixed, corners)
        tolerance = float(np.clip(NOISE_SHARE * np.sqrt(self.noise.variance.min()), TIGHTEST, TOLERANCE))
        return replace(self, simulator=self.simulator.within(box, tolerance))

    def select(self, tests: Sequence[str]) -> Problem:
        """The same problem on some of its tests."""
        index = [self.tests.index(name) for name in tests]
        drives = tuple(self.drives[i] for i in index)
        return replace(
            self,
            measurements=tuple(self.measurements[i] for i in index),
            records=tuple(self.records[i] for i in index),
            drives=drives,
            simulator=self.simulator.select(index),
            noise=self.noise.select(index),
        )


def build_problem(
    model: Model,
    campaign: Campaign,
    *,
    space: ParameterSpace | None = None,
    fixed: Mapping[str, float] | None = None,
    prior: GaussianPrior | None = None,
    settled: bool = False,
    jobs: int = 1,
) -> Problem:
    """Join a model and the tests of a campaign.

    Parameters
    ----------
    model
        Its channels and conditions are looked up in every test.
    campaign
        All of its tests are used.
    space
        Free parameters; all of the model's if not given.
    fixed
        Values of parameters that are not free; nominal if not given.
    prior
        Knowledge from earlier stages.
    settled
        Use only the samples after each test's transient, periodic or not.
    jobs
        Threads; results do not depend on it.

    Raises
    ------
    InputError
        With every channel and condition that a test lacks.
    """
    system = build_system(model)
    require(model, campaign)
    everything = ParameterSpace(model.parameters)
    space = everything if space is None else space
    values = {p.name: p.nominal for p in model.parameters if p.name not in space.names} | dict(fixed or {})
    records = tuple(analyse(measurement, first_input(model), model.outputs[0].name)
                    for measurement in campaign.measurements)  # fmt: skip
    drives = tuple(
        to_drive(model, measurement, record, settled)
        for measurement, record in zip(campaign.measurements, records, strict=True)
    )
    count = np.array([np.count_nonzero(drive.weights) for drive in drives], dtype=float)
    floor = np.array([_floor(record, model) for record in records])
    corners = np.array([[0.0], [1.0]]) * np.ones(len(space))
    simulator = Simulator(
        system,
        drives,
        space.names,
        jobs=jobs,
        tolerance=TOLERANCE,
        box=_box(system, space, values, corners),
    )
    return Problem(
        model=model,
        system=system,
        measurements=tuple(campaign.measurements),
        records=records,
        space=space,
        fixed=values,
        simulator=simulator,
        drives=drives,
        noise=Noise(count, floor, count.copy()),
        prior=prior,
    )


def _box(system: System, space: ParameterSpace, fixed: Mapping[str, float], corners: Array) -> tuple[Array, Array]:
    """Bounds of all the system's parameters from corners (2, d) of the unit cube; a fixed one has no width."""
    values = space.from_unit(corners)
    columns = [values[:, space.names.index(n)] if n in space.names else np.full(2, fixed[n]) for n in system.parameters]
    lower, upper = np.stack(columns, axis=1) if columns else np.zeros((2, 0))
    return lower, upper


def _floor(record: Record, model: Model) -> float:
    """NRMSD of the noise of all outputs together."""
    return float(np.sqrt(np.mean([record.noise_floor.get(c.name, 0.0) ** 2 for c in model.outputs])))
