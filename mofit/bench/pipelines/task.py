"""The job as plain arrays: all that a peer shares with mofit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.problem import Problem

Array = NDArray[np.float64]


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

    time: Array
    angle: Array
    force: Array
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
    """

    tests: tuple[Test, ...]
    lower: Array
    upper: Array
    logarithmic: NDArray[np.bool_]
    mean: Array
    precision: Array

    def values(self, u: Array) -> Array:
        """Parameter values at a point (d,)."""
        with np.errstate(divide="ignore", invalid="ignore"):  # of bounds that are not on a logarithmic scale
            geometric = self.lower * (self.upper / self.lower) ** u
        return np.where(self.logarithmic, geometric, self.lower + u * (self.upper - self.lower))

    def log_prior(self, u: Array) -> float:
        """Log density of the prior at a point (d,), up to a constant."""
        return float(-0.5 * (u - self.mean) @ self.precision @ (u - self.mean))


def task_of(problem: Problem) -> Task:
    """A problem with counted noise in plain arrays."""
    tests = []
    for drive, weight in zip(problem.drives, problem.noise.weights, strict=True):
        speed, _, fictitious = drive.conditions
        judged = drive.weights[:, 0] > 0
        tests.append(
            Test(
                time=drive.step * np.arange(drive.samples, dtype=float),
                angle=drive.inputs[:, 0],
                force=drive.measured[:, 0],
                judged=judged,
                speed=float(speed),
                fictitious=float(fictitious),
                sigma=float(1 / np.sqrt(weight * drive.weights[:, 0].max())),
            )
        )
    parameters, d = problem.space.parameters, len(problem.space)
    mean, precision = (
        (np.full(d, 0.5), np.zeros((d, d))) if problem.prior is None else problem.prior.spread_over(problem.space.names)
    )
    return Task(
        tuple(tests),
        np.array([p.lower for p in parameters]),
        np.array([p.upper for p in parameters]),
        np.array([p.scale == "log" for p in parameters]),
        mean,
        precision,
    )
