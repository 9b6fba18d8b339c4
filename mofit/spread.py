"""A problem whose posterior is as wide as the noise of its data and the gap of its model ask for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.few_steps import in_few_steps
from mofit.joint import JointProblem
from mofit.objectives import Adjustment, adjust
from mofit.one_period import in_one_period
from mofit.problem import Problem
from mofit.score import score

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpreadProblem:
    """One mode of a problem with the adjusted likelihood (`mofit.objectives.curvature`).

    Parameters
    ----------
    problem
        The problem, ready to be evaluated around the mode.
    adjustment
        The map at the mode's minimum.
    offset
        Negative log likelihood of the problem itself there, so that modes compare.
    squares
        Weighted squares there.
    gap_squares
        See `mofit.objectives.Score`.
    """

    problem: Problem | JointProblem
    adjustment: Adjustment
    offset: float
    squares: float
    gap_squares: tuple[float, float]

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density, shape (N,); -inf outside the cube or where a simulation fails."""
        result = np.full(len(u), -np.inf)
        inside = np.all((u >= 0) & (u <= 1), axis=1)
        if inside.any():
            points = u[inside]
            change = self.problem.squares(self.adjustment.mapped(points)) - self.squares
            value = self.offset + self.adjustment.value(change, points) + self.problem.prior_value(points)
            result[inside] = np.where(np.isfinite(value), -value, -np.inf)
        return result

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        a = self.adjustment
        squares, slope, curvature = self.problem.squares_terms(a.mapped(u))
        change = squares - self.squares
        shape = a.slope(change, u)[:, None]
        gradient = shape * (a.scale * slope @ a.map + 2 * a.linear)
        hessian = a.scale * shape[:, :, None] * np.einsum("ji,njk,kl->nil", a.map, curvature, a.map)
        return (
            self.offset + a.value(change, u) + self.problem.prior_value(u),
            gradient + self.problem.prior_gradient(u),
            hessian + self.problem.prior_precision,
        )

    def around(self, point: Array, spread: Array) -> SpreadProblem:
        """The same, quicker to evaluate around a point (d,) with standard deviations (d,).

        See `in_one_period` and `in_few_steps`; of a joint problem, the main one is quickened.
        """
        whole = self.problem
        taken = self.adjustment.mapped(point[None])

        def quick(problem: Problem) -> Problem:
            return in_few_steps(in_one_period(problem, taken[0], spread), taken[0], spread)

        problem = replace(whole, main=quick(whole.main)) if isinstance(whole, JointProblem) else quick(whole)
        change = problem.squares(taken) - whole.squares(taken)
        return replace(self, problem=problem, squares=self.squares + float(change[0]))

    @property
    def hessian(self) -> Array:
        """Of -log posterior at the minimum, shape (d, d)."""
        shape = (self.adjustment.freedom + len(self.adjustment.centre)) / self.adjustment.freedom
        return shape * self.adjustment.precision + self.problem.prior_precision


def spread_problems(problem: Problem | JointProblem, point: Array) -> tuple[SpreadProblem, SpreadProblem]:
    """The problem around a minimum (d,), with noise and gap, and with noise alone."""
    found = score(problem, point)
    offset = -float(problem.log_posterior(point[None])[0]) - float(problem.prior_value(point[None])[0])
    squares = float(problem.squares(point[None])[0])
    wide, narrow = (
        SpreadProblem(problem, adjust(found, point, with_gap), offset, squares, found.gap_squares)
        for with_gap in (True, False)
    )
    return wide, narrow


def spread_problem(problem: Problem | JointProblem, point: Array) -> SpreadProblem:
    """The problem around a minimum (d,), with noise and gap."""
    return spread_problems(problem, point)[0]
