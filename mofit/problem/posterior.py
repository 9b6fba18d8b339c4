"""What the stages of an identification ask of a posterior, and the joint one of several problems."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.problem.curvature_adjustment import Score, join_scores
from mofit.problem.likelihood import Noise
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

    def prior_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log prior (N,), its gradient (N, d) and Hessian (N, d, d)."""

    def value(self, u: FloatArray) -> FloatArray:
        """Negative log density (N,) as of `evaluate`, without derivatives; scoped parameters are not integrated out."""

    def squares(self, u: FloatArray) -> FloatArray:
        """Weighted sum of squares of all tests, shape (N,)."""

    def log_volume(self, u: FloatArray) -> FloatArray:
        """What the scoped parameters, integrated out, add to the negative log likelihood, shape (N,)."""

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


@dataclass(frozen=True)
class JointProblem:
    r"""Main problem plus companions that share some of its parameters.

    .. math:: -\log p(\theta) = -\log L_\mathrm{main}(\theta) - \sum_k \log L_k(\theta_{S_k})

    Points are in the unit cube of the main problem's space, as in `Problem`; noise is estimated for the main problem,
    the companions keep theirs.
    """

    main: Problem
    companions: tuple[Problem, ...]

    @property
    def space(self) -> ParameterSpace:
        """The main problem's free parameters."""
        return self.main.space

    def prior_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of the main problem's prior."""
        return self.main.prior_terms(u)

    def with_noise(self, noise: Noise) -> JointProblem:
        """Another noise of the main problem."""
        return replace(self, main=self.main.with_noise(noise))

    def with_noise_at(self, u: FloatArray) -> JointProblem:
        """The main problem's noise estimated at a point (d,)."""
        return replace(self, main=self.main.with_noise_at(u))

    def near(self, points: FloatArray, sd: FloatArray) -> JointProblem:
        """The main problem integrated for the neighbourhood of points only."""
        return replace(self, main=self.main.near(points, sd))

    def local(self, point: FloatArray, sd: FloatArray) -> JointProblem:
        """The main problem quick to simulate around a point."""
        return replace(self, main=self.main.local(point, sd))

    def squares(self, u: FloatArray) -> FloatArray:
        """Weighted sum of squares of all tests, shape (N,)."""
        total = self.main.squares(u)
        for companion in self.companions:
            total = total + companion.squares(self._mapped(companion, u)[0])
        return total

    def log_volume(self, u: FloatArray) -> FloatArray:
        """Of the main problem: companions have no scoped parameters."""
        return self.main.log_volume(u)

    def squares_terms(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same with gradient (N, d) and Gauss-Newton Hessian (N, d, d)."""
        return self._total(u, lambda problem, points: problem.squares_terms(points))

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (N,), gradient (N, d), Gauss-Newton Hessian (N, d, d)."""
        return self._total(u, lambda problem, points: problem.evaluate(points))

    def value(self, u: FloatArray) -> FloatArray:
        """Negative log posterior (N,) as of `evaluate`, without derivatives."""
        total = self.main.value(u)
        for companion in self.companions:
            total = total + companion.value(self._mapped(companion, u)[0])
        return total

    def log_posterior(self, u: FloatArray) -> FloatArray:
        """Log posterior density, shape (N,); -inf outside the cube or where a simulation fails."""
        result = self.main.log_posterior(u)
        usable = np.isfinite(result)
        if usable.any():
            for companion in self.companions:
                result[usable] += companion.log_posterior(self._mapped(companion, u[usable])[0])
        return result

    def score(self, point: FloatArray) -> Score:
        """Gradient, curvature and covariance of the gradient of every test at a point (d,)."""
        parts = [self.main.score(point)]
        for companion in self.companions:
            own, index, jacobian = self._mapped(companion, point[None])
            parts.append(companion.score(own[0]).embedded(index, jacobian[0], len(point)))
        return join_scores(parts)

    def _mapped(self, companion: Problem, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A companion's own coordinates at points (N, d), their indices in the main space, and d(own)/d(main)."""
        names = companion.space.names
        index = np.array([self.space.index(name) for name in names], dtype=int)
        values = self.space.from_unit(u)
        own = values[:, index]
        jacobian = self.space.derivative(values)[:, index] / companion.space.derivative(own)
        return companion.space.to_unit(own), index, jacobian

    def _total(
        self, u: FloatArray, terms: Callable[[Problem, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Terms of all problems added up, derivatives in the main problem's coordinates."""
        value, gradient, hessian = terms(self.main, u)
        for companion in self.companions:
            own, index, jacobian = self._mapped(companion, u)
            more, slope, curvature = terms(companion, own)
            value = value + more
            gradient[:, index] += slope * jacobian
            hessian[:, index[:, None], index[None, :]] += curvature * jacobian[:, :, None] * jacobian[:, None, :]
        return value, gradient, hessian
