"""One posterior from several kinds of test: the main problem and the calibration stages at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.objectives import Noise
from mofit.parameters import ParameterSpace
from mofit.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointProblem:
    r"""Main problem plus companions which share some of its parameters.

    .. math:: -\log p(\theta) = -\log L_\mathrm{main}(\theta) - \sum_k \log L_k(\theta_{S_k})

    Points are in the unit cube of the main problem's space, as in `Problem`.
    """

    main: Problem
    companions: tuple[Problem, ...]

    @property
    def space(self) -> ParameterSpace:
        """The main problem's free parameters."""
        return self.main.space

    @property
    def tests(self) -> tuple[str, ...]:
        """Tests of the main problem, then those of the companions."""
        return self.main.tests + tuple(test for companion in self.companions for test in companion.tests)

    def share(self, companion: Problem, u: Array) -> tuple[Array, Array, Array]:
        """A companion's own coordinates at points (N, d), their indices in the main space, and d(own)/d(main)."""
        names = companion.space.names
        index = np.array([self.space.index(name) for name in names], dtype=int)
        values = self.space.from_unit(u)
        own = values[:, index]
        stretch = self.space.slope(values)[:, index] / companion.space.slope(own)
        return companion.space.to_unit(own), index, stretch

    def near(self, points: Array, spread: Array) -> JointProblem:
        """The same, integrated for the neighbourhood of points only; see `Problem.near`."""
        return replace(self, main=self.main.near(points, spread))

    def with_noise_at(self, u: Array) -> JointProblem:
        """The same with the main problem's independent residuals counted at a point; the companions keep theirs."""
        return replace(self, main=self.main.with_noise_at(u))

    def with_noise(self, noise: Noise) -> JointProblem:
        """The same with another view of the main problem's noise."""
        return replace(self, main=self.main.with_noise(noise))

    def objectives(self, u: Array) -> Array:
        """NRMSD per test, shape (N, tests)."""
        parts = [self.main.objectives(u)]
        parts += [companion.objectives(self.share(companion, u)[0]) for companion in self.companions]
        return np.concatenate(parts, axis=1)

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Negative log posterior (N,), gradient (N, d), Gauss-Newton Hessian (N, d, d)."""
        return self._total(u, lambda problem, points: problem.evaluate(points))

    def squares_terms(self, u: Array) -> tuple[Array, Array, Array]:
        """Weighted sum of all tests' squares (N,), gradient (N, d), Gauss-Newton Hessian (N, d, d)."""
        return self._total(u, lambda problem, points: problem.squares_terms(points))

    def _total(
        self, u: Array, terms: Callable[[Problem, Array], tuple[Array, Array, Array]]
    ) -> tuple[Array, Array, Array]:
        """Terms of all problems added up, derivatives in the main problem's coordinates."""
        value, gradient, hessian = terms(self.main, u)
        for companion in self.companions:
            own, index, stretch = self.share(companion, u)
            more, slope, curvature = terms(companion, own)
            value = value + more
            gradient[:, index] += slope * stretch
            hessian[:, index[:, None], index[None, :]] += curvature * stretch[:, :, None] * stretch[:, None, :]
        return value, gradient, hessian

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density, shape (N,); -inf outside the cube or where a simulation fails."""
        result = self.main.log_posterior(u)
        usable = np.isfinite(result)
        if usable.any():
            for companion in self.companions:
                result[usable] += companion.log_posterior(self.share(companion, u[usable])[0])
        return result

    def squares(self, u: Array) -> Array:
        """Weighted sum of all tests' squares, shape (N,)."""
        total = self.main.squares(u)
        for companion in self.companions:
            total = total + companion.squares(self.share(companion, u)[0])
        return total

    @property
    def prior_precision(self) -> Array:
        """Of the main problem's Gaussian prior, shape (d, d)."""
        return self.main.prior_precision

    def prior_value(self, u: Array) -> Array:
        """Negative log density of the main problem's Gaussian prior up to a constant, shape (N,)."""
        return self.main.prior_value(u)

    def prior_gradient(self, u: Array) -> Array:
        """Its gradient, shape (N, d)."""
        return self.main.prior_gradient(u)
