"""What the stages of an identification ask of a posterior, whatever it is made of."""

from __future__ import annotations

from typing import Protocol, Self

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.problem.curvature_adjustment import Score
from mofit.problem.likelihood import Noise
from mofit.problem.prior import GaussianPrior
from mofit.problem.problem import Problem


class Posterior(Protocol):
    """A density over the unit cube of `space`; points u have shape (N, d).

    Outside the cube, and where a simulation fails, the log density is -inf. Derivatives may be exact or by differences.
    """

    @property
    def space(self) -> ParameterSpace:
        """The free parameters."""

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log density up to a constant, shape (N,)."""

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log density (N,), its gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""


class CampaignPosterior(Posterior, Protocol):
    """A posterior made of the tests of a campaign: `Problem`, `JointProblem`.

    The likelihood sees the tests as one weighted sum of squares, whose noise is estimated at a point.
    """

    @property
    def main(self) -> Problem:
        """The tests of the main identification, which results and reports show."""

    @property
    def prior_density(self) -> GaussianPrior:
        """The Gaussian prior over all free parameters; flat where nothing is known."""

    def squares(self, u: FloatArray) -> FloatArray:
        """Weighted sum of squares of all tests, shape (N,)."""

    def squares_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same with gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""

    def score(self, point: FloatArray) -> Score:
        """Gradient, curvature and covariance of the gradient of every test at a point (d,)."""

    def with_noise(self, noise: Noise) -> Self:
        """The same with another noise."""

    def with_noise_at(self, u: FloatArray) -> Self:
        """The same with the noise estimated at a point (d,)."""

    def near(self, points: FloatArray, sd: FloatArray) -> Self:
        """The same, integrated only for the neighbourhood of points (K, d) with standard deviations (d,)."""

    def local(self, point: FloatArray, sd: FloatArray) -> Self:
        """The same, as quick to simulate around a point (d,) as the tolerance allows (`mofit.problem.local_model`)."""
