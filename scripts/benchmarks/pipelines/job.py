"""The job of mofit and its peers: the bundled campaign as a problem, as arrays, and as a fast log posterior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.refinement import refined
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.optimize import Minimum, merge, refine
from mofit.problem import Problem
from mofit.sampling import laplace_covariance

MODEL = "maxwell_tyre"
#: A power of two keeps the Sobol points balanced.
STARTS = 16


def pose(settings: Settings, campaign: Campaign) -> tuple[Problem, Minimum]:
    """Calibrations as priors, noise counted at the best minimum; and that minimum."""
    problem = set_up_problem(find_model(MODEL), campaign, settings).posterior.main
    counted, minima = refined(problem, qmc.Sobol(len(problem.space), rng=settings.seed).random(STARTS))
    return counted, minima[0]


@dataclass(frozen=True)
class Test:
    """One sine test.

    Parameters
    ----------
    time, angle, force
        s, rad and N, shape (n,).
    judged
        Samples that count; the transient does not.
    speed, fictitious
        Of the wheel, and what keeps the slip finite at standstill, m/s.
    sigma
        Standard deviation of an independent residual, N.
    """

    __test__ = False  # not a pytest class

    time: FloatArray
    angle: FloatArray
    force: FloatArray
    judged: NDArray[np.bool_]
    speed: float
    fictitious: float
    sigma: float


@dataclass(frozen=True)
class Task:
    """Tests, bounds and prior. A point of the unit cube stands for values between the bounds.

    Parameters
    ----------
    tests
        The data.
    lower, upper, logarithmic
        Bounds per parameter, and whether its logarithm is linear in the unit coordinate; shape (d,).
    mean, precision
        Gaussian prior in unit coordinates, (d,) and (d, d).
    nominal, free
        Values of all parameters of the model, and the places of the free ones among them.
    """

    tests: tuple[Test, ...]
    lower: FloatArray
    upper: FloatArray
    logarithmic: NDArray[np.bool_]
    mean: FloatArray
    precision: FloatArray
    nominal: FloatArray
    free: NDArray[np.intp]

    def values(self, u: FloatArray) -> FloatArray:
        """Values of all parameters at a point (d,)."""
        with np.errstate(divide="ignore", invalid="ignore"):  # of bounds that are not on a logarithmic scale
            geometric = self.lower * (self.upper / self.lower) ** u
        values = self.nominal.copy()
        values[self.free] = np.where(self.logarithmic, geometric, self.lower + u * (self.upper - self.lower))
        return values

    def log_prior(self, u: FloatArray) -> float:
        """Log density of the prior at a point (d,), up to a constant."""
        return float(-0.5 * (u - self.mean) @ self.precision @ (u - self.mean))


def task_of(problem: Problem) -> Task:
    """A problem with counted noise in plain arrays."""
    tests = []
    for experiment, weight in zip(problem.experiments, problem.noise.weights, strict=True):
        speed, _, fictitious = experiment.conditions
        judged = experiment.weights[:, 0] > 0
        tests.append(
            Test(
                time=experiment.step * np.arange(experiment.samples, dtype=float),
                angle=experiment.inputs[:, 0],
                force=experiment.measured[:, 0],
                judged=judged,
                speed=float(speed),
                fictitious=float(fictitious),
                sigma=float(1 / np.sqrt(weight * experiment.weights[:, 0].max())),
            )
        )
    parameters = problem.space.parameters
    prior = problem.prior_density
    return Task(
        tuple(tests),
        np.array([p.lower for p in parameters]),
        np.array([p.upper for p in parameters]),
        np.array([p.scale == "log" for p in parameters]),
        prior.mean,
        prior.precision,
        np.array([p.nominal for p in problem.model.parameters]),
        np.array([[p.name for p in problem.model.parameters].index(p.name) for p in parameters]),
    )


#: points (N, d) of the unit cube -> log posterior (N,), -inf outside; or negative log posterior and gradient (N, d)
Evaluate = Callable[[FloatArray], Any]


@dataclass(frozen=True)
class Fast:
    """Gaussian likelihood of a problem's noise, and its prior.

    Parameters
    ----------
    problem
        With counted noise.
    offset
        Of the squares, which a quickened problem leaves out.
    """

    problem: Problem
    offset: float = 0.0

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log posterior, shape (N,); -inf outside the unit cube or where the simulation fails."""
        result = np.full(len(u), -np.inf)
        inside = np.all((u >= 0) & (u <= 1), axis=1)
        if inside.any():
            squares = self.problem.squares(u[inside]) + self.offset
            value = 0.5 * squares + self.problem.prior_density.value(u[inside])
            result[inside] = np.where(np.isfinite(value), -value, -np.inf)
        return result

    def descent(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Negative log posterior (N,) and its gradient (N, d)."""
        value, gradient, _ = self.evaluate(u)
        return value, gradient

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        squares, slope, curvature = self.problem.squares_terms(u)
        return (
            0.5 * (squares + self.offset) + self.problem.prior_density.value(u),
            0.5 * slope + self.problem.prior_density.gradient(u),
            0.5 * curvature + self.problem.prior_density.precision,
        )

    def local(self, point: FloatArray, sd: FloatArray) -> Fast:
        """The same, quicker to evaluate around a point (d,) with standard deviations (d,), as mofit samples."""
        near = self.problem.near(point[None], sd)
        quick = near.local(point, sd)
        return Fast(quick, float(near.squares(point[None])[0] - quick.squares(point[None])[0]))


class Recorded:
    """A function of batches of points that remembers the points, in order."""

    def __init__(self, function: Evaluate) -> None:
        self.function = function
        self.batches: list[FloatArray] = []

    def __call__(self, u: FloatArray) -> Any:
        """What the function gives."""
        self.batches.append(np.array(u))
        return self.function(u)

    @property
    def points(self) -> int:
        """How many points were evaluated."""
        return sum(map(len, self.batches))


@dataclass(frozen=True)
class Job:
    """What all peers do.

    Parameters
    ----------
    task
        As plain arrays.
    whole, near
        Its log posterior by mofit's kernel in the box, and around the best minimum.
    best
        Negative log posterior of that minimum.
    """

    task: Task
    whole: Fast
    near: Fast
    best: float


def make_job(problem: Problem, minimum: Minimum) -> Job:
    """The job on a problem whose noise was counted at a minimum."""
    whole = Fast(problem)
    best = merge(refine(whole.evaluate, minimum.point[None]))[0]
    near = whole.local(best.point, np.sqrt(np.diag(laplace_covariance(best.hessian))))
    return Job(task_of(problem), whole, near, best.value)
