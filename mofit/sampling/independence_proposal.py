"""The independence proposal: a mixture of Student-t distributions, fitted to draws, and its autocorrelation time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.special import gammaln, logsumexp

from mofit._typing import FloatArray
from mofit.sampling.bend import Bend, fitted_bend

FIRST_FREEDOM = 5.0
"""Degrees of freedom of a proposal that is not fitted to draws."""
DEGREES_OF_FREEDOM = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0)
"""Degrees of freedom tried: heavy tails for any shape, to lighter ones that forgive what few draws don't show. Where
the noise is known from few degrees of freedom, the posterior has tails of its own, which those of q must not fall
below: a posterior whose noise has 2 of them needs fewer."""
MOST_COMPONENTS = 16
"""Each needs some dozens of draws to be fitted to."""
WORTHWHILE = 0.9
"""Twice as many components, or a bend, are kept if they shorten the autocorrelation by a tenth."""
QUICK = 3.0
"""Autocorrelation time, in steps, up to which a mixture is good enough without a bend."""


def in_cube(points: FloatArray) -> NDArray[np.bool_]:
    """Which points (n, d) lie in the unit cube, shape (n,)."""
    return np.all((points >= 0) & (points <= 1), axis=1)


@dataclass(frozen=True)
class StudentTMixture:
    r"""Mixture of multivariate Student-t distributions.

    .. math:: q(x) = \sum_k w_k\, \frac{\Gamma((\nu + d)/2)}{\Gamma(\nu/2) (\nu\pi)^{d/2} |L_k|}
              \left(1 + \frac{|L_k^{-1}(x - \mu_k)|^2}{\nu}\right)^{-(\nu + d)/2}, \quad L_k L_k^T = S_k

    Parameters
    ----------
    weights
        w, shape (K,), of sum 1.
    means, scales
        mu (K, d) and the scale matrices S (K, d, d), positive definite.
    freedom
        nu, degrees of freedom.
    bend
        Shear whose straight coordinates the mixture is in; none: those of the cube.
    """

    weights: FloatArray
    means: FloatArray
    scales: FloatArray
    freedom: float
    bend: Bend | None = None

    @classmethod
    def single(cls, mean: FloatArray, scale: FloatArray, freedom: float) -> StudentTMixture:
        """One component, mean (d,) and scale matrix (d, d)."""
        return cls(np.ones(1), np.asarray(mean, dtype=float)[None], np.asarray(scale, dtype=float)[None], freedom)

    @cached_property
    def _factors(self) -> FloatArray:
        return np.asarray(np.linalg.cholesky(self.scales), dtype=float)

    @cached_property
    def _whiteners(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._factors), dtype=float)

    @cached_property
    def _constants(self) -> FloatArray:
        nu, dimension = self.freedom, self.means.shape[1]
        peak = gammaln((nu + dimension) / 2) - gammaln(nu / 2) - dimension / 2 * np.log(nu * np.pi)
        determinants = np.sum(np.log(np.diagonal(self._factors, axis1=1, axis2=2)), axis=1)
        return np.asarray(np.log(self.weights) + peak - determinants)

    def selected(self, kept: NDArray[np.bool_]) -> StudentTMixture | None:
        """The mixture of some of its components (K,); None of none."""
        weights = self.weights[kept]
        if weights.size == 0:
            return None
        return replace(self, weights=weights / weights.sum(), means=self.means[kept], scales=self.scales[kept])

    def distance(self, points: FloatArray) -> FloatArray:
        """Of points (n, d) to the nearest component, in its standard deviations, shape (n,)."""
        gaps = points[None] - self.means[:, None]
        return np.asarray(np.linalg.norm(gaps @ self._whiteners.transpose(0, 2, 1), axis=2).min(axis=0))

    def log_density(self, points: FloatArray) -> FloatArray:
        """Log density at points (n, d), shape (n,)."""
        places = points if self.bend is None else self.bend.straight(points)
        gaps = places[None] - self.means[:, None]
        distance = np.sum((gaps @ self._whiteners.transpose(0, 2, 1)) ** 2, axis=2)
        logs = self._constants[:, None] - (self.freedom + points.shape[1]) / 2 * np.log1p(distance / self.freedom)
        return np.asarray(logs[0] if len(logs) == 1 else logsumexp(logs, axis=0))

    def draw(self, random: np.random.RandomState, count: int) -> FloatArray:
        """Draws, shape (count, d), from emcee's kind of generator."""
        shape = count, self.means.shape[1]
        which = np.searchsorted(np.cumsum(self.weights)[:-1], random.random_sample(count), side="right")
        steps = random.standard_normal(shape)
        for k in range(len(self.weights)):
            steps[which == k] = steps[which == k] @ self._factors[k].T
        stretch = np.sqrt(random.chisquare(self.freedom, count) / self.freedom)
        drawn = np.asarray(self.means[which] + steps / stretch[:, None])
        return drawn if self.bend is None else self.bend.bent(drawn)

    def draw_inside(self, random: np.random.RandomState, count: int, rounds: int = 64) -> FloatArray:
        """Draws cut off at the faces of the unit cube, shape (count, d).

        Draws outside are replaced, up to `rounds` times; what is outside even then is returned as it is. Up to a
        constant, the density inside is thus that of the whole distribution.
        """
        draws = self.draw(random, count)
        for _ in range(rounds - 1):
            missing = np.flatnonzero(~in_cube(draws))
            if missing.size == 0:
                break
            draws[missing] = self.draw(random, len(missing))
        return draws


def predicted_time(proposal: StudentTMixture, points: FloatArray, log_prob: FloatArray) -> float:
    r"""Autocorrelation time that independent proposals from q would leave, in steps, of the worst parameter.

    A walker at x waits on average :math:`1/a(x)` steps for its next move, so that

    .. math:: \tau \approx E_\pi\!\left[z^2 \left(\frac{2}{a(x)} - 1\right)\right], \quad
              a(x) = E_{y \sim q} \min\left(1, \frac{w(y)}{w(x)}\right)
                   = \frac{E_{y \sim \pi} \min(v(x), v(y))}{E_\pi v}, \quad w = \frac{\pi}{q} = \frac1v

    with z the standardised parameter: draws from the target suffice, and walkers that would stick in its tails count.

    Parameters
    ----------
    proposal
        q.
    points, log_prob
        Draws from the target (n, d) and their log density (n,), of any normalisation.
    """
    logs = proposal.log_density(points) - log_prob
    ratio = np.exp(logs - logs.max())
    order = np.argsort(ratio)
    lesser = np.cumsum(ratio[order])
    count = np.arange(len(ratio) - 1, -1, -1)
    accepted = np.empty_like(ratio)
    accepted[order] = (lesser + count * ratio[order]) / lesser[-1]
    square = (points - points.mean(axis=0)) ** 2
    spread = np.maximum(square.mean(axis=0), np.finfo(float).tiny)
    with np.errstate(divide="ignore", over="ignore"):
        return float(np.max((2 / accepted - 1) @ square / spread) / len(points))


def best_proposal(
    points: FloatArray, log_prob: FloatArray, former: StudentTMixture | None = None
) -> tuple[StudentTMixture, float]:
    """Mixture of Student-t distributions fitted to draws, or the former one if that would do better, and its time.

    The number of components is doubled as long as that pays; each is tried with several degrees of freedom. If that is
    slow still, one component is bent, by the widest direction alone up to all of them: few draws tell few terms. More
    components then follow the bend that does best. Fitted to every other pair of draws and judged by the rest, then
    fitted to all.

    Parameters
    ----------
    points, log_prob
        Draws from the target (n, d) and their log density (n,).
    former
        What has been used so far.

    Returns
    -------
    The proposal, and its `predicted_time`.
    """
    choice = _Choice(points, log_prob, former)
    choice.offer(1, 0, 1.0)
    choice.add_components(0)
    if choice.time > QUICK:
        most = points.shape[1] - 1
        levels = [2**k for k in range((most - 1).bit_length())] + [most]
        bends = [wide for wide in levels if choice.offer(1, wide)]
        if bends:
            choice.add_components(bends[-1])
    assert choice.proposal is not None  # a time is finite
    return choice.proposal, choice.time


class _Choice:
    """The best proposal so far, each fitted to half of the draws and judged by the other half."""

    def __init__(self, points: FloatArray, log_prob: FloatArray, former: StudentTMixture | None) -> None:
        self.points, self.judging = points, np.arange(len(points)) % 4 < 2
        self.log_prob = log_prob[self.judging]
        self.proposal, self.time = former, np.inf
        if former is not None:
            self.time, freedom = self._judged(former)
            self.proposal = replace(former, freedom=freedom)

    def offer(self, components: int, wide: int, gain: float = WORTHWHILE) -> bool:
        """Whether so many components, along a bend by so many directions, do better by that factor; kept if so."""
        tried = _fitted(self.points[~self.judging], components, wide)
        time, freedom = (np.inf, 0.0) if tried is None else self._judged(tried)
        if not time < self.time * gain:
            return False
        whole = _fitted(self.points, components, wide)
        self.time, self.proposal = time, None if whole is None else replace(whole, freedom=freedom)
        return True

    def add_components(self, wide: int) -> None:
        """Double the components as long as that pays."""
        components = 2
        while components <= MOST_COMPONENTS and self.offer(components, wide):
            components *= 2

    def _judged(self, mixture: StudentTMixture) -> tuple[float, float]:
        """Least predicted time, and the degrees of freedom that it takes."""
        points = self.points[self.judging]
        return min(
            (predicted_time(replace(mixture, freedom=nu), points, self.log_prob), nu) for nu in DEGREES_OF_FREEDOM
        )


def _fitted(points: FloatArray, components: int, wide: int) -> StudentTMixture | None:
    """A mixture fitted to draws (n, d), along a bend by so many directions if any; None if that can't be had."""
    bend = fitted_bend(points, wide) if wide else None
    if wide and bend is None:
        return None
    places = points if bend is None else bend.straight(points)
    return StudentTMixture(*fitted_mixture(places, components), FIRST_FREEDOM, bend)


def fitted_mixture(
    points: FloatArray, components: int, iterations: int = 30
) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Weights (K,), means (K, d) and covariances (K, d, d) of a mixture of Gaussians, by expectation maximisation.

    The covariances have an inverse Wishart prior around :math:`C / K^{2/d}`, C being the covariance of all draws, worth
    d + 2 draws, which keeps them positive definite.

    Parameters
    ----------
    points
        Draws, shape (n, d).
    components
        K.
    iterations
        Of expectation maximisation.

    References
    ----------
    Fraley, Raftery: Bayesian regularization for normal mixture estimation and model-based clustering (2007).
    """
    count, dimension = points.shape
    whole = np.cov(points, rowvar=False).reshape(dimension, dimension)
    whole = whole + 1e-9 * np.diag(np.diag(whole)) + np.finfo(float).tiny * np.eye(dimension)
    if components == 1:
        return np.ones(1), points.mean(axis=0)[None], whole[None]
    prior, worth = whole / components ** (2 / dimension), dimension + 2
    start = np.random.default_rng(0)  # fixed: where a fit begins, not a random draw of the chain
    means = points[start.choice(count, components, replace=False)]
    weights, covariances = np.full(components, 1 / components), np.tile(prior, (components, 1, 1))
    for _ in range(iterations):
        logs = np.stack([
            np.log(w) + _log_normal(points, m, c)
            for w, m, c in zip(weights, means, covariances, strict=True)
        ])  # fmt: skip
        share = np.exp(logs - logsumexp(logs, axis=0))
        mass = share.sum(axis=1)
        weights = (mass + 1) / (count + components)
        means = (share @ points + means) / (mass + 1)[:, None]
        gaps = points[None] - means[:, None]
        scatter = np.einsum("kn,kni,knj->kij", share, gaps, gaps, optimize=True)
        covariances = (scatter + worth * prior) / (mass + worth)[:, None, None]
    return weights, means, covariances


def _log_normal(points: FloatArray, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log density of a Gaussian at points (n, d), shape (n,)."""
    size, axes = eigh(covariance)
    whitened = (points - mean) @ (axes * np.sqrt(1 / size))
    constant = len(mean) * np.log(2 * np.pi) + np.sum(np.log(size))
    return np.asarray(-0.5 * (constant + np.sum(whitened**2, axis=1)))
