"""The identification problem: a model, its tests, the free parameters, the noise and the prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.data.signals import REPEATED, SignalAnalysis
from mofit.models import Model, System
from mofit.parameters import ParameterLayout, ParameterSpace
from mofit.problem.curvature_adjustment import Score
from mofit.problem.likelihood import (
    Noise,
    TestSums,
    likelihood_terms,
    negative_log_likelihood,
    nrmsd,
)
from mofit.problem.local_model import coarse_steps, fold_periods, star
from mofit.problem.objectives import independent_residuals, objective_names
from mofit.problem.pooling import Pooling
from mofit.problem.prior import FLAT, GaussianPrior, inside_cube
from mofit.problem.scoped_covariance import scoped_covariance
from mofit.problem.score_covariance import score_covariance
from mofit.simulation import ExperimentData, Simulator
from mofit.simulation.evaluation.evaluations import Evaluations, evaluations_of
from mofit.simulation.experiment import objectives_of
from mofit.simulation.scoped_simulator import ScopedSimulator
from mofit.simulation.scopes import scoped

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
    """A model and its tests over the unit cube of the free parameters; points ``u`` have shape (N, d).

    A point outside the cube or whose simulation fails has objective nan and log posterior -inf.
    """

    model: Model
    system: System
    measurements: tuple[Measurement, ...]
    signals: tuple[SignalAnalysis, ...]
    """Period, transient and noise of every test."""
    layout: ParameterLayout
    """Which parameters are free, and the values of the others."""
    simulator: Simulator
    experiments: tuple[ExperimentData, ...]
    """The tests as the simulator takes them."""
    noise: Noise
    prior: GaussianPrior = FLAT
    """What earlier stages know of some free parameters."""
    pooling: Pooling | None = None
    """The normals of pooled parameters; their means and spreads are the last free parameters."""
    repeats: tuple[tuple[str, ...], ...] = ()
    """Names of tests that repeat one another, see `mofit.data.repeats`."""

    @property
    def main(self) -> Problem:
        """The problem itself: it has no companions."""
        return self

    @property
    def space(self) -> ParameterSpace:
        """The free parameters."""
        return self.layout.space

    @property
    def evaluations(self) -> Evaluations | None:
        """The simulations of a user's simulator; None of a model that has equations."""
        return evaluations_of(self.model)

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests."""
        return tuple(measurement.name for measurement in self.measurements)

    @property
    def objective_names(self) -> tuple[str, ...]:
        """Names of the objectives: the tests, or ``test / output`` where the model has several outputs."""
        return objective_names(self.model, self.experiments)

    @property
    def periods(self) -> list[float | None]:
        """Period of every test in s, None where it has none."""
        return [analysis.period for analysis in self.signals]

    @cached_property
    def prior_density(self) -> GaussianPrior:
        """The prior over all free parameters."""
        return self.prior.over(self.space.names)

    def objectives(self, u: FloatArray) -> FloatArray:
        """NRMSD of every test and output measured in it (eq. 10), shape (N, objectives)."""
        values = nrmsd(self.simulator.cost(self.layout.full(u)), self.noise.count)
        return np.where(np.isfinite(values), values, np.nan)

    def sums(self, u: FloatArray) -> TestSums:
        """Cost, gradient and Gauss-Newton matrix per objective, in unit coordinates."""
        cost, gradient, normal = self.simulator.gauss_newton(self.layout.full(u))
        simulated = gradient.shape[-1]
        slope = self.space.derivative(self.space.from_unit(u))[:, :simulated]
        more = [(0, 0), (0, 0), (0, len(self.space) - simulated)]  # means and spreads move no output
        return TestSums(
            cost=cost,
            gradient=np.pad(gradient * slope[:, None, :], more),
            normal=np.pad(normal * slope[:, None, :, None] * slope[:, None, None, :], [*more, more[-1]]),
        )

    def gradients(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        r"""NRMSD per objective (N, T) and its gradient :math:`J_t^T W r_t / (n_t \mathrm{NRMSD}_t)`, (N, T, d)."""
        sums = self.sums(u)
        values = nrmsd(sums.cost, self.noise.count)
        values = np.where(np.isfinite(values), values, np.nan)
        scale = np.maximum(self.noise.count * values, np.finfo(float).tiny)
        return values, sums.gradient / scale[..., None]

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        likelihood, prior = likelihood_terms(self.sums(u), self.noise), self.prior_terms(u)
        value, gradient, hessian = (one + other for one, other in zip(likelihood, prior, strict=True))
        return value, gradient, hessian

    def prior_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log prior (N,), that of pooled parameters included, with gradient (N, d) and Hessian (N, d, d)."""
        prior = self.prior_density
        value, gradient = prior.value(u), prior.gradient(u)
        hessian = np.tile(prior.precision, (len(u), 1, 1))
        if self.pooling is None:
            return value, gradient, hessian
        more = self.pooling.terms(self.space, u)
        return value + more[0], gradient + more[1], hessian + more[2]

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log posterior density in the unit cube up to a constant, shape (N,); -inf outside or where it fails."""
        return inside_cube(u, lambda points: self.value(points) + self.log_volume(points))

    def value(self, u: FloatArray) -> FloatArray:
        """Negative log posterior (N,) as of `evaluate`, without derivatives."""
        cost = self.simulator.cost(self.layout.full(u))
        return negative_log_likelihood(cost, self.noise) + self.prior_terms(u)[0]

    def log_volume(self, u: FloatArray) -> FloatArray:
        """What the scoped parameters, integrated out, add to the negative log likelihood, shape (N,)."""
        return self.simulator.log_volume(self.layout.full(u))

    def squares(self, u: FloatArray) -> FloatArray:
        """Weighted sum of all objectives' squares, shape (N,), as the likelihood sees them."""
        return np.asarray(self.simulator.cost(self.layout.full(u)) @ self.noise.weights)

    def squares_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same with gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        sums, weights = self.sums(u), self.noise.weights
        return (
            np.asarray(sums.cost @ weights),
            2 * np.einsum("t,ntd->nd", weights, sums.gradient),
            2 * np.einsum("t,ntde->nde", weights, sums.normal),
        )

    def score(self, point: FloatArray) -> Score:
        """Gradient, curvature and covariance of the gradient of every objective at a point (d,)."""
        derivative = self.space.derivative(self.space.from_unit(point))
        values = self.layout.full(point[None])

        def in_unit(response: FloatArray) -> tuple[FloatArray, FloatArray]:
            slopes = np.zeros((*response.shape[1:3], len(derivative)))
            slopes[..., : response.shape[-1] - 1] = response[0, ..., 1:]
            slopes *= derivative
            return response[0, ..., 0].copy(), slopes

        sums = self.sums(point[None])
        experiments = self._with_common_residuals(values)
        responses = map(in_unit, self.simulator.one_by_one(values, derivatives=True))
        weights, memory = self.noise.weights, self.noise.memory
        return score_covariance(sums, weights, experiments, self.periods, responses, memory)

    def _with_common_residuals(self, values: FloatArray) -> tuple[ExperimentData, ...]:
        r"""The tests with residuals that count repeated records as what they are, at one set (1, np).

        What the model lacks is the same in all n repeats: their scores do not average it out. A residual of
        :math:`\sqrt{n}` times the mean of theirs in each of them has the spectrum of the noise and n times that of the
        gap, so that the sum over the repeats is right for both.
        """
        groups = [[self.tests.index(name) for name in group if name in self.tests] for group in self.repeats]
        groups = [[k for k in group if self.signals[k].noise_method == REPEATED] for group in groups]
        found = list(self.experiments)
        for group in (group for group in groups if len(group) > 1):
            simulated = [output[0] for output in self.simulator.select(group).simulate(values)]
            residuals = [found[k].measured - output for k, output in zip(group, simulated, strict=True)]
            common = np.sqrt(len(group)) * np.mean(residuals, axis=0)
            for k, output in zip(group, simulated, strict=True):
                found[k] = replace(found[k], measured=output + common)
        return tuple(found)

    def simulate(self, u: FloatArray) -> list[FloatArray]:
        """Simulated outputs per test, shape (N, samples, outputs)."""
        return self.simulator.simulate(self.layout.full(u))

    def with_noise_at(self, u: FloatArray) -> Problem:
        """The problem with its noise as seen at one point u (d,)."""
        responses = self.simulator.one_by_one(self.layout.full(u[None]), derivatives=False)
        independent = independent_residuals(self.experiments, (response[0, ..., 0] for response in responses))
        found = self.with_noise(self.noise.at(self.objectives(u[None])[0], independent))
        return found.pooled_at(u)

    def scoped_covariance(self, u: FloatArray) -> FloatArray:
        """Covariance of the scoped values in unit coordinates at a point u (d,), (G, m, m)."""
        assert isinstance(self.simulator, ScopedSimulator)
        p, gap = self.layout.full(u[None]), self.score(u).gap_squares
        return scoped_covariance(self.simulator, p, self.periods, self.noise.weights, gap)

    def pooled_at(self, u: FloatArray) -> Problem:
        """With the normals of pooled parameters around a point u (d,), if there are any."""
        if len(self.space) == len(self.simulator.free):
            return self
        assert isinstance(self.simulator, ScopedSimulator)
        p = self.layout.full(u[None])
        return replace(self, pooling=Pooling.of(self.simulator, p, self.scoped_covariance(u), self.space, u))

    def with_noise(self, noise: Noise) -> Problem:
        """The problem with another view of its noise."""
        return replace(self, noise=noise, simulator=self.simulator.weighted(noise.weights))

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The problem with other values of parameters that are not free; those of free ones are ignored."""
        return replace(self, layout=self.layout.with_fixed(values))

    def with_free(self, space: ParameterSpace, fixed: Mapping[str, float], prior: GaussianPrior = FLAT) -> Problem:
        """The same tests with other free parameters, values of the others and prior; data are shared.

        Scoped parameters stay as they are.
        """
        space, own = scoped(space)
        fixed = {**fixed, **dict(zip(own.names, own.nominal, strict=True))}
        layout, simulator = ParameterLayout.of_model(self.model.parameters, space, fixed), self.simulator
        simulated = tuple(name for name in layout.space.names if name in self.system.parameters)
        if simulated == simulator.free:
            simulator = simulator.within(layout.box(), TOLERANCE)
        else:
            simulator = simulator.with_free(simulated, layout.box(), TOLERANCE)
        return replace(self, layout=layout, simulator=simulator, prior=prior)

    def near(self, points: FloatArray, sd: FloatArray) -> Problem:
        """The same problem, integrated for the neighbourhood of points (K, d) with standard deviations (d,) only.

        The number of integration steps need not cover the stiffest corner of the whole box then.
        """
        reach = REACH * sd
        box = self.layout.box(np.clip([points.min(axis=0) - reach, points.max(axis=0) + reach], 0.0, 1.0))
        tolerance = float(np.clip(NOISE_SHARE * np.sqrt(self.noise.variance.min()), TIGHTEST, TOLERANCE))
        found = replace(self, simulator=self.simulator.within(box, tolerance))
        if len(points) > 1:
            return found
        found = replace(found, simulator=found.simulator.around(self.layout.full(points)))
        return found if self.pooling is None else found.pooled_at(points[0])

    def local(self, point: FloatArray, sd: FloatArray) -> Problem:
        """The same problem, as quick to simulate around a point (d,) as the tolerance allows.

        Good for standard deviations (d,) around it; see `mofit.problem.local_model`. A user's simulator stays as it is.
        """
        if self.evaluations is not None:
            return self
        values = self.layout.full(star(point, sd))
        simulator = self.simulator.around(values[:1])
        simulator, experiments = fold_periods(simulator, self.experiments, self.periods, values)
        simulator, experiments = coarse_steps(simulator, experiments, values)
        return replace(self, simulator=simulator, experiments=experiments)

    def select(self, tests: Sequence[str]) -> Problem:
        """The same problem on some of its tests."""
        index = [self.tests.index(name) for name in tests]
        simulator = self.simulator.select(index)
        noise = replace(self.noise.select(objectives_of(self.experiments, index)), absorbed=simulator.absorbed)
        return replace(
            self,
            measurements=tuple(self.measurements[i] for i in index),
            signals=tuple(self.signals[i] for i in index),
            experiments=tuple(self.experiments[i] for i in index),
            simulator=simulator,
            noise=noise,
        )
