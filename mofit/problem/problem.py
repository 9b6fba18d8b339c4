"""The identification problem: a model, its tests, the free parameters, the noise and the prior."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Measurement
from mofit.data.signals import SignalAnalysis, analyse
from mofit.models import Model, System, build_system
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
from mofit.problem.objectives import first_noise, independent_residuals, objective_names, objectives_of
from mofit.problem.prior import FLAT, GaussianPrior
from mofit.problem.score_covariance import score_covariance
from mofit.simulation import ExperimentData, Simulator, experiment_data, first_input, measured_outputs, require

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

    @property
    def main(self) -> Problem:
        """The problem itself: it has no companions."""
        return self

    @property
    def space(self) -> ParameterSpace:
        """The free parameters."""
        return self.layout.space

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
        slope = self.space.derivative(self.space.from_unit(u))
        return TestSums(
            cost=cost,
            gradient=gradient * slope[:, None, :],
            normal=normal * slope[:, None, :, None] * slope[:, None, None, :],
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
        value, gradient, hessian = likelihood_terms(self.sums(u), self.noise)
        prior = self.prior_density
        return value + prior.value(u), gradient + prior.gradient(u), hessian + prior.precision

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log posterior density in the unit cube up to a constant, shape (N,); -inf outside or where it fails."""

        def likelihood(points: FloatArray) -> FloatArray:
            return negative_log_likelihood(self.simulator.cost(self.layout.full(points)), self.noise)

        return self.prior_density.log_posterior(u, likelihood)

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

        def responses() -> Iterator[tuple[FloatArray, FloatArray]]:
            for k in range(len(self.experiments)):  # one by one: all samples' sensitivities together are large
                ((output, slopes),) = self.simulator.select([k]).sensitivities(values)
                yield output[0], slopes[0] * derivative

        sums = self.sums(point[None])
        return score_covariance(sums, self.noise.weights, self.experiments, self.periods, responses())

    def simulate(self, u: FloatArray) -> list[FloatArray]:
        """Simulated outputs per test, shape (N, samples, outputs)."""
        return self.simulator.simulate(self.layout.full(u))

    def with_noise_at(self, u: FloatArray) -> Problem:
        """The problem with its noise as seen at one point u (d,)."""
        independent = independent_residuals(self.experiments, [output[0] for output in self.simulate(u[None])])
        return replace(self, noise=self.noise.at(self.objectives(u[None])[0], independent))

    def with_noise(self, noise: Noise) -> Problem:
        """The problem with another view of its noise."""
        return replace(self, noise=noise)

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The problem with other values of parameters that are not free; those of free ones are ignored."""
        return replace(self, layout=self.layout.with_fixed(values))

    def with_free(self, space: ParameterSpace, fixed: Mapping[str, float], prior: GaussianPrior = FLAT) -> Problem:
        """The same tests with other free parameters, values of the others and prior; data are shared."""
        layout, simulator = ParameterLayout.of_model(self.model.parameters, space, fixed), self.simulator
        if layout.space.names == self.space.names:
            simulator = simulator.within(layout.box(), TOLERANCE)
        else:
            simulator = simulator.with_free(layout.space.names, layout.box(), TOLERANCE)
        return replace(self, layout=layout, simulator=simulator, prior=prior)

    def near(self, points: FloatArray, sd: FloatArray) -> Problem:
        """The same problem, integrated for the neighbourhood of points (K, d) with standard deviations (d,) only.

        The number of integration steps need not cover the stiffest corner of the whole box then.
        """
        reach = REACH * sd
        box = self.layout.box(np.clip([points.min(axis=0) - reach, points.max(axis=0) + reach], 0.0, 1.0))
        tolerance = float(np.clip(NOISE_SHARE * np.sqrt(self.noise.variance.min()), TIGHTEST, TOLERANCE))
        return replace(self, simulator=self.simulator.within(box, tolerance))

    def local(self, point: FloatArray, sd: FloatArray) -> Problem:
        """The same problem, as quick to simulate around a point (d,) as the tolerance allows.

        Good for standard deviations (d,) around it; see `mofit.problem.local_model`.
        """
        values = self.layout.full(star(point, sd))
        simulator, experiments = fold_periods(self.simulator, self.experiments, self.periods, values)
        simulator, experiments = coarse_steps(simulator, experiments, values)
        return replace(self, simulator=simulator, experiments=experiments)

    def select(self, tests: Sequence[str]) -> Problem:
        """The same problem on some of its tests."""
        index = [self.tests.index(name) for name in tests]
        return replace(
            self,
            measurements=tuple(self.measurements[i] for i in index),
            signals=tuple(self.signals[i] for i in index),
            experiments=tuple(self.experiments[i] for i in index),
            simulator=self.simulator.select(index),
            noise=self.noise.select(objectives_of(self.experiments, index)),
        )


def build_problem(
    model: Model,
    campaign: Campaign,
    *,
    space: ParameterSpace | None = None,
    fixed: Mapping[str, float] | None = None,
    prior: GaussianPrior = FLAT,
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
        With every channel and condition that a test lacks; of several outputs it may lack some.
    """
    system = build_system(model)
    require(model, campaign)
    layout = ParameterLayout.of_model(model.parameters, space, fixed)
    excitation, tests = first_input(model), campaign.measurements
    signals = tuple(analyse(test, excitation, measured_outputs(model, test)[0]) for test in tests)
    experiments = tuple(
        experiment_data(model, measurement, analysis, settled)
        for measurement, analysis in zip(tests, signals, strict=True)
    )
    return Problem(
        model=model,
        system=system,
        measurements=tuple(tests),
        signals=signals,
        layout=layout,
        simulator=Simulator(system, experiments, layout.space.names, jobs=jobs, tolerance=TOLERANCE, box=layout.box()),
        experiments=experiments,
        noise=first_noise(model, tests, signals, experiments),
        prior=prior,
    )
