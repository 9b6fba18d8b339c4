"""The task's log posterior by mofit's kernel: what the evaluations of slow peers are counted with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit.few_steps import in_few_steps
from mofit.one_period import in_one_period
from mofit.problem import Problem

Array = NDArray[np.float64]
#: points (N, d) of the unit cube -> log posterior (N,), -inf outside; or negative log posterior and gradient (N, d)
Evaluate = Callable[[Array], Any]


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

    def log_posterior(self, u: Array) -> Array:
        """Log posterior, shape (N,); -inf outside the unit cube or where the simulation fails."""
        result = np.full(len(u), -np.inf)
        inside = np.all((u >= 0) & (u <= 1), axis=1)
        if inside.any():
            squares = self.problem.squares(u[inside]) + self.offset
            value = 0.5 * squares + self.problem.prior_value(u[inside])
            result[inside] = np.where(np.isfinite(value), -value, -np.inf)
        return result

    def descent(self, u: Array) -> tuple[Array, Array]:
        """Negative log posterior (N,) and its gradient (N, d)."""
        value, gradient, _ = self.evaluate(u)
        return value, gradient

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        squares, slope, curvature = self.problem.squares_terms(u)
        return (
            0.5 * (squares + self.offset) + self.problem.prior_value(u),
            0.5 * slope + self.problem.prior_gradient(u),
            0.5 * curvature + self.problem.prior_precision,
        )

    def around(self, point: Array, spread: Array) -> Fast:
        """The same, quicker to evaluate around a point (d,) with standard deviations (d,), as mofit samples."""
        near = self.problem.near(point[None], spread)
        quick = in_few_steps(in_one_period(near, point, spread), point, spread)
        return Fast(quick, float(near.squares(point[None])[0] - quick.squares(point[None])[0]))


class Recorded:
    """A function of batches of points that remembers the points, in order."""

    def __init__(self, function: Evaluate) -> None:
        self.function = function
        self.batches: list[Array] = []

    def __call__(self, u: Array) -> Any:
        """What the function gives."""
        self.batches.append(np.array(u))
        return self.function(u)

    @property
    def points(self) -> int:
        """How many points were evaluated."""
        return sum(map(len, self.batches))
