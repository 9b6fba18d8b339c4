"""The posterior adjusted to the noise of the data and the gap of the model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.problem.curvature_adjustment import Adjustment, Score, adjust
from mofit.problem.posterior import CampaignPosterior
from mofit.problem.prior import inside_cube


@dataclass(frozen=True)
class AdjustedPosterior:
    """One mode of a problem with the adjusted likelihood (`mofit.problem.curvature_adjustment`)."""

    problem: CampaignPosterior
    adjustment: Adjustment
    """The map at the mode's minimum."""
    offset: float
    """Negative log likelihood of the problem itself there, so that modes compare."""
    squares: float
    """Weighted squares there."""
    score: Score
    """Of every objective there."""
    volume: float
    """`CampaignPosterior.log_volume` there."""

    @property
    def space(self) -> ParameterSpace:
        """The free parameters."""
        return self.problem.space

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log posterior density, shape (N,); -inf outside the cube or where a simulation fails."""

        def volume(points: FloatArray) -> FloatArray:
            return self.problem.log_volume(self.adjustment.mapped(points)) - self.volume

        return inside_cube(u, lambda points: self.value(points) + volume(points))

    def value(self, u: FloatArray) -> FloatArray:
        """Negative log posterior (N,) as of `evaluate`, without derivatives."""
        change = self.problem.squares(self.adjustment.mapped(u)) - self.squares
        return self.offset + self.adjustment.value(change, u) + self.problem.prior_terms(u)[0]

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        a, prior = self.adjustment, self.problem.prior_terms(u)
        squares, slope, curvature = self.problem.squares_terms(a.mapped(u))
        change = squares - self.squares
        shape = a.slope(change, u)[:, None]
        gradient = shape * (a.scale * slope @ a.map + 2 * a.linear)
        hessian = a.scale * shape[:, :, None] * np.einsum("ji,njk,kl->nil", a.map, curvature, a.map)
        return (
            self.offset + a.value(change, u) + prior[0],
            gradient + prior[1],
            hessian + prior[2],
        )

    def with_slopes_of(self, problem: CampaignPosterior) -> AdjustedPosterior:
        """Of the same problem in another form, with the adjustment that its slopes ask for."""
        centre = self.adjustment.centre
        score = problem.score(centre)
        return replace(self, problem=problem, score=score, adjustment=adjust(score, centre, with_gap=True))

    def unmapped(self) -> AdjustedPosterior:
        """The same for a valley that bends, which the map would distort."""
        adjustment = adjust(self.score, self.adjustment.centre, with_gap=True, mapped=False)
        return replace(self, adjustment=adjustment)

    def local(self, point: FloatArray, sd: FloatArray) -> AdjustedPosterior:
        """The same, quicker to evaluate around a point (d,) with standard deviations (d,); see `Problem.local`."""
        whole = self.problem
        mapped = self.adjustment.mapped(point[None])
        quick = whole.local(mapped[0], sd)
        change = quick.squares(mapped) - whole.squares(mapped)
        return replace(self, problem=quick, squares=self.squares + float(change[0]))

    @property
    def hessian(self) -> FloatArray:
        """Of -log posterior at the minimum, shape (d, d)."""
        return self._hessian(self.adjustment)

    @property
    def noise_hessian(self) -> FloatArray:
        """What it would be if the model had no gap, shape (d, d)."""
        return self._hessian(adjust(self.score, self.adjustment.centre, with_gap=False))

    @property
    def normal_hessian(self) -> FloatArray:
        """Of the normal distribution whose intervals are as wide as this posterior's, shape (d, d).

        The curvature at the minimum would be too large for it: a t distribution has a sharp peak and wide tails.
        """
        normal = adjust(self.score.for_a_normal(), self.adjustment.centre, with_gap=True)
        return normal.precision + self.problem.prior_terms(self.adjustment.centre[None])[2][0]

    def _hessian(self, adjustment: Adjustment) -> FloatArray:
        shape = (adjustment.freedom + len(adjustment.centre)) / adjustment.freedom
        return shape * adjustment.precision + self.problem.prior_terms(adjustment.centre[None])[2][0]


def adjusted_posterior(problem: CampaignPosterior, point: FloatArray, *, with_gap: bool = True) -> AdjustedPosterior:
    """The posterior around a minimum (d,), adjusted to noise and gap, or to noise alone."""
    score = problem.score(point)
    here = point[None]
    offset = -float(problem.log_posterior(here)[0]) - float(problem.prior_terms(here)[0][0])
    squares, volume = float(problem.squares(here)[0]), float(problem.log_volume(here)[0])
    return AdjustedPosterior(problem, adjust(score, point, with_gap), offset, squares, score, volume)
