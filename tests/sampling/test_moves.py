"""The proposals leave known targets invariant; the densities are what they say."""

import numpy as np
import pytest
from scipy import stats

from mofit.sampling import laplace_covariance
from mofit.sampling.ensemble import Ensemble, advance
from mofit.sampling.independence_proposal import StudentTMixture
from mofit.sampling.moves import IndependenceMove, SnookerMove

COVARIANCE = 0.01 * np.array([[1.0, 0.7, 0.0], [0.7, 1.5, -0.4], [0.0, -0.4, 0.8]])


def gaussian(x):
    return -0.5 * np.einsum("ni,ij,nj->n", x - 0.5, np.linalg.inv(COVARIANCE), x - 0.5)


def steep_at_a_face(x):
    """Exponential in x0 from the face x0 = 0, normal beside it, nothing outside the cube."""
    inside = np.all((x >= 0) & (x <= 1), axis=1)
    return np.where(
        inside, -8 * x[:, 0] - 0.5 * ((x[:, 1] - 0.4) / 0.1) ** 2 - 0.5 * ((x[:, 2] - 0.6) / 0.2) ** 2, -np.inf
    )


def exact_draws(target, rng, n):
    if target is gaussian:
        return rng.multivariate_normal(np.full(3, 0.5), COVARIANCE, n)
    x0 = stats.truncexpon(8, scale=1 / 8).rvs(n, random_state=rng)
    x1 = stats.truncnorm(-4, 6, 0.4, 0.1).rvs(n, random_state=rng)
    x2 = stats.truncnorm(-3, 2, 0.6, 0.2).rvs(n, random_state=rng)
    return np.column_stack([x0, x1, x2])


MISFIT = StudentTMixture(  # fits neither target
    np.array([0.7, 0.3]),
    np.array([[0.35, 0.45, 0.55], [0.7, 0.6, 0.4]]),
    np.array([np.diag([0.15, 0.13, 0.15]) ** 2, 0.04 * np.eye(3)]),
    5.0,
)
MOVES = {
    "student": lambda: IndependenceMove(MISFIT),
    "snooker": SnookerMove,
}


@pytest.mark.parametrize("target", [gaussian, steep_at_a_face], ids=lambda f: f.__name__)
@pytest.mark.parametrize("move", MOVES)
def test_a_move_leaves_its_target_invariant(move, target):
    """Walkers drawn exactly from the target still follow it after some steps: each walker is one independent draw."""
    rng = np.random.default_rng([7, len(move)])
    walkers, repeats, steps = 40, 60, 12
    ensembles = []
    for _ in range(repeats):
        seed = np.random.RandomState(np.random.MT19937(rng.integers(2**31)))
        positions = exact_draws(target, rng, walkers)
        ensembles.append(Ensemble.at(positions, target(positions), seed.get_state()))
    moved = advance(target, ensembles, [(MOVES[move](), 1.0)], steps)
    assert 0.05 < np.mean([ensemble.accepted for ensemble in moved]) / steps < 0.99
    ends = np.concatenate([ensemble.positions for ensemble in moved])
    reference = exact_draws(target, rng, 200_000)
    for k in range(3):
        assert stats.ks_2samp(ends[:, k], reference[:, k]).pvalue > 1e-4
    mean_error = (ends.mean(axis=0) - reference.mean(axis=0)) / (reference.std(axis=0) / np.sqrt(len(ends)))
    assert np.all(np.abs(mean_error) < 4.5)
    pairs = (ends - reference.mean(axis=0))[:, [0, 1]].prod(axis=1)
    exact = (reference - reference.mean(axis=0))[:, [0, 1]].prod(axis=1)
    assert abs(pairs.mean() - exact.mean()) < 4.5 * exact.std() / np.sqrt(len(ends))


def test_student_density_is_scipys():
    x = np.random.default_rng(0).normal(0.5, 0.3, (50, 3))
    parts = [stats.multivariate_t(m, s, 5.0).pdf(x) for m, s in zip(MISFIT.means, MISFIT.scales, strict=True)]
    np.testing.assert_allclose(MISFIT.log_density(x), np.log(MISFIT.weights @ parts), rtol=1e-12)
    own = StudentTMixture.single(np.full(3, 0.5), COVARIANCE, 5.0).log_density(x)
    np.testing.assert_allclose(own, stats.multivariate_t(np.full(3, 0.5), COVARIANCE, 5.0).logpdf(x), rtol=1e-12)


def test_draws_of_a_mixture_have_its_moments():
    draws = MISFIT.draw(np.random.RandomState(np.random.MT19937(4)), 100_000)
    mean = MISFIT.weights @ MISFIT.means
    gaps = MISFIT.means - mean
    covariance = np.tensordot(MISFIT.weights, 5 / 3 * MISFIT.scales + gaps[:, :, None] * gaps[:, None], 1)
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.005)
    np.testing.assert_allclose(np.cov(draws, rowvar=False), covariance, atol=0.003)


def test_draws_inside_follow_the_distribution_cut_off_at_the_faces():
    random = np.random.RandomState(np.random.MT19937(3))
    mean, sd = np.array([0.0, 0.9]), np.array([0.3, 0.2])
    draws = StudentTMixture.single(mean, np.diag(sd**2), 1e6).draw_inside(random, 20_000)
    assert np.all((draws >= 0) & (draws <= 1))
    for k, (low, high) in enumerate([(0, 1 / 0.3), (-4.5, 0.5)]):
        exact = stats.truncnorm(low, high, mean[k], sd[k])
        assert stats.kstest(draws[:, k], exact.cdf).pvalue > 1e-4


def test_laplace_covariance_inverts_what_is_known_and_caps_what_is_not():
    precise = np.diag([1e6, 4e4])
    np.testing.assert_allclose(laplace_covariance(precise), np.linalg.inv(precise), rtol=1e-3)
    ridge = 1e6 * np.ones((2, 2))
    covariance = laplace_covariance(ridge)
    along = np.array([1, -1]) / np.sqrt(2)
    assert along @ covariance @ along == pytest.approx(1 / 12)
    assert np.all(np.linalg.eigvalsh(laplace_covariance(np.diag([-5.0, 0.0]))) == pytest.approx(1 / 12))


def test_a_part_of_a_mixture_has_weights_of_sum_1():
    whole = StudentTMixture(np.array([0.5, 0.3, 0.2]), np.arange(6.0).reshape(3, 2), np.tile(np.eye(2), (3, 1, 1)), 5.0)
    part = whole.selected(np.array([True, False, True]))
    assert part.weights == pytest.approx([5 / 7, 2 / 7])
    assert part.means == pytest.approx(whole.means[[0, 2]])
    assert whole.selected(np.zeros(3, bool)) is None
