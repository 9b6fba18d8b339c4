"""Bridge sampling against exact integrals over the cube, from draws of the sampler and from exact draws."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.special import logsumexp

from mofit.sampling import (
    Draws,
    SampleSettings,
    bridge_log_evidence,
    laplace_covariance,
    mixture,
    mode_region,
    mode_weights,
    restricted,
    sample_mode,
)


def gaussian(dimension):
    root = np.random.default_rng(dimension).normal(size=(dimension, dimension))
    covariance = 0.03**2 * (root @ root.T / dimension + 0.2 * np.eye(dimension))
    precision = np.linalg.inv(covariance)

    def target(x):
        return -7 - 0.5 * np.einsum("ni,ij,nj->n", x - 0.5, precision, x - 0.5)

    exact = -7 + dimension / 2 * np.log(2 * np.pi) + 0.5 * np.linalg.slogdet(covariance)[1]
    return target, np.full(dimension, 0.5), covariance, exact


def truncated(dimension):
    """Normal with its peak at a face in the first parameter, exponential towards a face in the second."""

    def target(x):
        return -0.5 * (x[:, 0] / 0.1) ** 2 - 15 * (1 - x[:, 1]) - 0.5 * np.sum(((x[:, 2:] - 0.5) / 0.05) ** 2, axis=1)

    exact = np.log(0.1 * np.sqrt(np.pi / 2)) + np.log((1 - np.exp(-15)) / 15)
    exact += (dimension - 2) * np.log(0.05 * np.sqrt(2 * np.pi))
    centre = np.r_[0.0, 1.0, np.full(dimension - 2, 0.5)]
    return target, centre, laplace_covariance(np.diag([100.0, 200.0, *[400.0] * (dimension - 2)])), exact


def banana(dimension):
    def target(x):
        bent = -0.5 * ((x[:, 0] - 0.5) / 0.1) ** 2 - 0.5 * ((x[:, 1] - 0.3 - 3 * (x[:, 0] - 0.5) ** 2) / 0.03) ** 2
        return bent - 0.5 * np.sum(((x[:, 2:] - 0.5) / 0.05) ** 2, axis=1)

    def slice_mass(x):
        middle = 0.3 + 3 * (x - 0.5) ** 2
        inside = stats.norm.cdf((1 - middle) / 0.03) - stats.norm.cdf(-middle / 0.03)
        return np.exp(-0.5 * ((x - 0.5) / 0.1) ** 2) * inside * 0.03 * np.sqrt(2 * np.pi)

    exact = np.log(quad(slice_mass, 0, 1, points=[0.2, 0.5, 0.8])[0])
    exact += (dimension - 2) * np.log(0.05 * np.sqrt(2 * np.pi))
    centre = np.r_[0.5, 0.3, np.full(dimension - 2, 0.5)]
    return target, centre, laplace_covariance(np.diag([100.0, 1 / 0.03**2, *[400.0] * (dimension - 2)])), exact


def student(dimension):
    known = stats.multivariate_t(np.full(dimension, 0.5), 1e-6 * np.eye(dimension), df=4)

    def target(x):
        return 3 + known.logpdf(x)

    return target, np.full(dimension, 0.5), 1e-6 * np.eye(dimension), 3.0


OTHERS = [(truncated, 2), (truncated, 5), (banana, 2), (banana, 4), (student, 2), (student, 6)]
TARGETS = [gaussian(d) for d in range(1, 9)] + [make(d) for make, d in OTHERS]
NAMES = [f"gaussian-{d}" for d in range(1, 9)] + [f"{make.__name__}-{d}" for make, d in OTHERS]
#: enough for the evidence; these tests don't ask for converged chains
SHORT = SampleSettings(max_steps=250)


@pytest.mark.parametrize(("target", "centre", "covariance", "exact"), TARGETS, ids=NAMES)
def test_evidence_is_the_exact_integral(target, centre, covariance, exact):
    chains = sample_mode(target, centre, covariance, 1, SHORT)
    found = bridge_log_evidence(target, chains.thinned(), 2)
    assert found.log_evidence == pytest.approx(exact, abs=0.1)
    assert abs(found.log_evidence - exact) < 5 * found.error
    assert found.error < 0.05
    again = bridge_log_evidence(target, chains.thinned(), 2)
    assert again == found


def test_the_error_is_the_scatter_of_repetitions():
    """Estimates from 100 independent sets of exact, autocorrelated draws scatter as their errors say."""
    rng, rho, dimension = np.random.default_rng(5), 0.7, 2
    target, centre, covariance, exact = gaussian(dimension)
    factor = np.linalg.cholesky(covariance)
    pulls = []
    for repetition in range(100):
        z = rng.normal(size=(4, 120, dimension))
        for t in range(1, 120):
            z[:, t] = rho * z[:, t - 1] + np.sqrt(1 - rho**2) * z[:, t]
        points = centre + z @ factor.T
        index = np.zeros((4, 120), dtype=int)
        log_prob = target(points.reshape(-1, dimension)).reshape(4, 120)
        found = bridge_log_evidence(target, Draws(points, log_prob, index, index), repetition)
        pulls.append((found.log_evidence - exact) / found.error)
    assert 0.75 < np.std(pulls) < 1.35
    assert abs(np.mean(pulls)) < 0.4


def two_modes(dimension, gap):
    """A narrow mode and a wide one with three times its mass, `gap` apart; their Laplace descriptions, the weights."""
    centres = np.full((2, dimension), 0.5) + np.array([[-0.5], [0.5]]) * gap * np.eye(dimension)[0]
    sd = np.array([0.02, 0.04])
    heights = np.log([0.25, 0.75]) - dimension * np.log(sd * np.sqrt(2 * np.pi))

    def target(x):
        gaps = np.sum((x[:, None] - centres) ** 2, axis=2) / sd**2
        return logsumexp(heights - 0.5 * gaps, axis=1)

    return target, -heights, centres, sd[:, None, None] ** 2 * np.eye(dimension)


@pytest.mark.parametrize(("dimension", "gap"), [(2, 0.4), (5, 0.4), (2, 0.2)])
def test_weights_and_quantiles_of_a_mixture_of_two_modes(dimension, gap):
    target, values, centres, covariances = two_modes(dimension, gap)
    draws, logs = [], []
    for k in range(2):
        own = restricted(target, mode_region(k, values, centres, covariances))
        chains = sample_mode(own, centres[k], covariances[k], (3, k), SHORT)
        assert not chains.left.any()
        draws.append(chains.thinned())
        logs.append(bridge_log_evidence(own, draws[-1], k).log_evidence)
    assert logsumexp(logs) == pytest.approx(0.0, abs=0.05)  # the regions fill the cube
    weights = mode_weights(logs)
    np.testing.assert_allclose(np.log(weights), np.log([0.25, 0.75]), atol=0.1)

    whole = mixture(draws, weights)
    share = np.array([0.05, 0.2, 0.5, 0.95])
    known = 0.25 * stats.norm.cdf(whole.quantiles(share)[:, 0], centres[0, 0], 0.02)
    known += 0.75 * stats.norm.cdf(whole.quantiles(share)[:, 0], centres[1, 0], 0.04)
    np.testing.assert_allclose(known, share, atol=0.03)
    np.testing.assert_allclose(whole.mean()[0], np.array([0.25, 0.75]) @ centres[:, 0], atol=0.02 * gap)
    points, mode = whole.draw(np.random.default_rng(0), 20_000)
    assert (mode == 1).mean() == pytest.approx(weights[1], abs=0.015)
    np.testing.assert_allclose(points.std(axis=0), whole.sd(), rtol=0.03)


def test_regions_partition_the_cube_and_keep_walkers_out_of_a_known_mode():
    target, values, centres, covariances = two_modes(2, 0.12)  # 3 and 6 standard deviations: walkers would go over
    points = np.random.default_rng(0).uniform(size=(1000, 2))
    belongs = np.stack([mode_region(k, values, centres, covariances)(points) for k in range(2)])
    assert np.all(belongs.sum(axis=0) == 1)
    mine = mode_region(0, values, centres, covariances)
    chains = sample_mode(restricted(target, mine), centres[0], covariances[0], 4, SHORT)
    assert mine(chains.chain.reshape(-1, 2)).all()
    free = sample_mode(target, centres[0], covariances[0], 4, SHORT)
    assert not mine(free.chain.reshape(-1, 2)).all()
