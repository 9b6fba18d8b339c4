"""Evidence of a sampled mode by bridge sampling, with its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from mofit._typing import FloatArray
from mofit.sampling.chains import Draws
from mofit.sampling.convergence import effective_size
from mofit.sampling.ensemble import LogPosterior, safe
from mofit.sampling.independence_proposal import StudentTMixture, best_proposal, in_cube

MOST_PROPOSALS = 4000
"""Points at which the posterior is computed, at most: an error of a few hundredths even where the fit is poor."""
BATCH = 16384
"""Draws of the proposal at a time, to find how much of it lies inside the cube."""


@dataclass(frozen=True)
class Evidence:
    """Log of the posterior mass of a mode, ln Z, and its standard error, the relative error of Z."""

    log_evidence: float
    error: float


def bridge_log_evidence(log_posterior: LogPosterior, draws: Draws, seed: int) -> Evidence:
    r"""Posterior mass of the mode that draws come from, over the unit cube.

    A mixture q of Student-t distributions, cut off at the faces of the cube, is fitted to the first half of the draws.
    With :math:`l = \pi / q` at the other :math:`n_1` draws x and at :math:`n_2` draws y of q, the fixed point of

    .. math:: Z = \frac{\frac1{n_2} \sum_j \frac{l(y_j)}{s_1 l(y_j) + s_2 Z}}
                       {\frac1{n_1} \sum_i \frac{1}{s_1 l(x_i) + s_2 Z}}, \quad s_k = \frac{n_k}{n_1 + n_2},

    is the optimal bridge estimate, :math:`n_1` counted as effective draws. Its relative error, with
    :math:`f_1 = \hat\pi / (s_1 \hat\pi + s_2 q)`, :math:`f_2 = q / (s_1 \hat\pi + s_2 q)`, :math:`\hat\pi = \pi/Z`, is

    .. math:: \mathrm{RE}^2 = \frac{V_q f_1}{n_2 E_q^2 f_1} + \frac{\rho}{n_1} \frac{V_\pi f_2}{E_\pi^2 f_2}
              + \frac{1 - p}{p N}

    with rho the autocorrelation time of f_2 and the last term from p, the share of q inside the cube, seen in N draws.

    Parameters
    ----------
    log_posterior
        What was sampled; -inf or nan count as zero density.
    draws
        Of that mode, at least 16 per chain.
    seed
        Of the draws of q.

    References
    ----------
    Meng, Wong: Simulating ratios of normalizing constants via a simple identity (1996). Frühwirth-Schnatter: Estimating
    marginal likelihoods for mixture and Markov switching models using bridge sampling techniques (2004).
    """
    chains, count, dimension = draws.points.shape
    half = count // 2
    fitted = draws.points[:, :half].reshape(-1, dimension), draws.log_prob[:, :half].ravel()
    proposal, _ = best_proposal(*fitted)
    points, log_prob = draws.points[:, half:], draws.log_prob[:, half:]
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed)))
    drawn, inside, tried = _drawn(proposal, random, min(points[..., 0].size, MOST_PROPOSALS))
    log_inside = float(np.log(inside / tried))

    at_draws = log_prob.ravel() - proposal.log_density(points.reshape(-1, dimension)) + log_inside
    at_proposals = safe(log_posterior)(drawn) - proposal.log_density(drawn) + log_inside
    effective = _effective(at_draws.reshape(chains, -1))
    share = np.log(effective / (effective + len(drawn))), np.log(len(drawn) / (effective + len(drawn)))
    log_z = _fixed_point(at_draws, at_proposals, share)

    first = np.exp(at_proposals - log_z - np.logaddexp(share[0] + at_proposals - log_z, share[1]))
    second = np.exp(-np.logaddexp(share[0] + at_draws - log_z, share[1]))
    variance = first.var() / first.mean() ** 2 / len(drawn)
    variance += second.var() / second.mean() ** 2 / _effective(second.reshape(chains, -1))
    variance += (tried - inside) / (inside * tried)
    return Evidence(log_z, float(np.sqrt(variance)))


def _fixed_point(at_draws: FloatArray, at_proposals: FloatArray, share: tuple[float, float]) -> float:
    """Log of the fixed point of the bridge equation, from the logs of l."""
    log_z = float(np.median(at_draws))
    for _ in range(1000):
        above = logsumexp(at_proposals - np.logaddexp(share[0] + at_proposals, share[1] + log_z))
        below = logsumexp(-np.logaddexp(share[0] + at_draws, share[1] + log_z))
        former, log_z = log_z, float(above - np.log(len(at_proposals)) - below + np.log(len(at_draws)))
        if abs(log_z - former) < 1e-10:
            break
    return log_z


def _effective(values: FloatArray) -> float:
    """Effective number of a function's values along the chains, shape (chain, draw), at most all of them."""
    return float(min(effective_size(values[..., None])[0], values.size))


def _drawn(proposal: StudentTMixture, random: np.random.RandomState, count: int) -> tuple[FloatArray, int, int]:
    """Draws inside the cube, how many there were, and of how many."""
    found: list[FloatArray] = []
    inside = tried = 0
    while inside < count and tried < 256 * BATCH:
        draws = proposal.draw(random, BATCH)
        found.append(draws[in_cube(draws)])
        inside, tried = inside + len(found[-1]), tried + BATCH
    return np.concatenate(found)[:count], inside, tried
