"""The sampler on posteriors with known moments, and what it says of those it cannot sample."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mofit.errors import InputError
from mofit.sampling import SampleSettings, StudentTMixture, effective_size, laplace_covariance, r_hat, sample_mode
from mofit.sampling.chains import assess
from mofit.sampling.convergence import stuck_walkers
from mofit.sampling.ensemble import safe
from mofit.sampling.state import begin, extend, produce, refit

D = 8
ROOT = np.random.default_rng(1).normal(size=(D, D))
COVARIANCE = 0.03**2 * (ROOT @ ROOT.T / D + 0.1 * np.eye(D))
PRECISION = np.linalg.inv(COVARIANCE)


def gaussian(x):
    return -0.5 * np.einsum("ni,ij,nj->n", x - 0.5, PRECISION, x - 0.5)


def check_moments(chains, mean, sd):
    """Mean and sd of every parameter within 4.5 of their own standard errors."""
    draws = chains.thinned().points
    flat = draws.reshape(-1, draws.shape[2])
    assert np.all(np.abs(flat.mean(axis=0) - mean) < 4.5 * sd / np.sqrt(chains.ess))
    assert np.all(np.abs(flat.std(axis=0) / sd - 1) < 4.5 * 1.5 / np.sqrt(chains.ess))


def test_correlated_gaussian_converges_in_few_steps_to_its_moments():
    chains = sample_mode(gaussian, np.full(D, 0.5), COVARIANCE, seed=1)
    assert chains.converged, chains.reasons
    assert chains.tau.max() < 2
    check_moments(chains, np.full(D, 0.5), np.sqrt(np.diag(COVARIANCE)))
    assert chains.evaluations == 4 * 24 * (1 + chains.burn_in + chains.steps)
    draws = chains.thinned()
    assert draws.points.shape[:2] == draws.log_prob.shape == draws.walker.shape
    np.testing.assert_allclose(draws.log_prob, gaussian(draws.points.reshape(-1, D)).reshape(draws.log_prob.shape))
    chain, draw = 2, 40
    where = chain, draws.step[chain, draw], draws.walker[chain, draw]
    np.testing.assert_array_equal(draws.points[chain, draw], chains.chain[where])
    np.testing.assert_array_equal(chains.r_hat, r_hat(draws.points))
    np.testing.assert_array_equal(chains.ess, effective_size(draws.points))


def test_a_wrong_laplace_approximation_is_mended_by_the_burn_in():
    chains = sample_mode(gaussian, np.full(D, 0.47), 9 * np.diag(np.diag(COVARIANCE)), seed=2)
    assert chains.converged, chains.reasons
    check_moments(chains, np.full(D, 0.5), np.sqrt(np.diag(COVARIANCE)))


@pytest.mark.parametrize("expected", [1.0, 50.0])
def test_chains_that_mix_slowly_start_anew_with_a_proposal_fitted_to_them(expected):
    """Whether the proposal promised better or not."""
    settings, target = SampleSettings(), safe(gaussian)
    narrow = StudentTMixture.single(np.full(D, 0.5), 0.02 * COVARIANCE, 5.0)
    right = StudentTMixture.single(np.full(D, 0.5), COVARIANCE, 5.0)
    run = produce(begin(target, right, np.random.SeedSequence(4), settings), settings)
    run = extend(target, replace(run, proposal=narrow, time=expected), settings, 200, run.tau)
    tau = assess(run, settings).tau
    assert tau.max() > 5
    fresh = refit(run, tau, settings)
    assert (fresh.steps, fresh.burned) == (0, 200)
    assert fresh.time < tau.max() / 2
    np.testing.assert_allclose(fresh.proposal.scales[0], COVARIANCE, atol=0.3 * COVARIANCE.max())
    np.testing.assert_array_equal(fresh.ensembles[0].positions, run.ensembles[0].positions)
    fresh = extend(target, fresh, settings, 200, tau)
    assert assess(fresh, settings).tau.max() < tau.max() / 2
    promised = np.full(D, fresh.time)
    assert refit(fresh, promised, settings) is fresh


def test_banana():
    a, b = 0.12, 3.0

    def banana(x):
        return -0.5 * ((x[:, 0] - 0.5) / a) ** 2 - 0.5 * ((x[:, 1] - 0.3 - b * (x[:, 0] - 0.5) ** 2) / 0.03) ** 2

    hessian = np.diag([1 / a**2, 1 / 0.03**2])
    chains = sample_mode(banana, [0.5, 0.3], laplace_covariance(hessian), seed=3)
    assert chains.converged, chains.reasons
    # moments over the box by quadrature
    x, y = np.meshgrid(np.linspace(0, 1, 2001), np.linspace(0, 1, 2001), indexing="ij")
    density = np.exp(banana(np.column_stack([x.ravel(), y.ravel()]))).reshape(x.shape)
    density /= density.sum()
    mean = np.array([(density * x).sum(), (density * y).sum()])
    sd = np.sqrt([(density * (x - mean[0]) ** 2).sum(), (density * (y - mean[1]) ** 2).sum()])
    draws = chains.thinned().points.reshape(-1, 2)
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.1 * sd.min())
    np.testing.assert_allclose(draws.std(axis=0), sd, rtol=0.1)
    assert not chains.left.any()


def test_truncated_at_a_bound_and_flat_in_another_direction():
    def target(x):
        return -20 * x[:, 0] - 0.5 * ((x[:, 1] - 0.5) / 0.01) ** 2

    chains = sample_mode(target, [0.0, 0.5, 0.5], laplace_covariance(np.diag([0.0, 1e4, 0.0])), seed=4)
    assert chains.converged, chains.reasons
    exact = stats.truncexpon(20, scale=1 / 20)
    check_moments(chains, np.array([exact.mean(), 0.5, 0.5]), np.array([exact.std(), 0.01, np.sqrt(1 / 12)]))
    draws = chains.thinned().points.reshape(-1, 3)
    assert stats.kstest(draws[:, 2], "uniform").pvalue > 1e-4
    assert stats.kstest(draws[:, 0], exact.cdf).pvalue > 1e-4


def two_modes(x):
    peaks = [-0.5 * np.sum(((x - c) / 0.02) ** 2, axis=1) for c in (0.3, 0.7)]
    return np.logaddexp(*peaks)


def test_walkers_that_sit_in_another_mode_are_counted_and_left_out():
    # stretch moves cannot jump between the modes; three walkers of each ensemble are put into the other one
    settings = SampleSettings(walkers=32, independence=0.0, differential=0.0, stretch=1.0, snooker=0.0)
    run = produce(
        begin(
            two_modes,
            StudentTMixture.single(np.full(2, 0.3), 4e-4 * np.eye(2), 5.0),
            np.random.SeedSequence(5),
            settings,
        ),
        settings,
    )
    moved = []
    for ensemble in run.ensembles:
        positions = ensemble.positions.copy()
        positions[:3] += 0.4
        moved.append(type(ensemble)(positions, two_modes(positions), *list(vars(ensemble).values())[2:]))
    gap = two_modes(np.full((1, 2), 0.5))[0]
    assert gap < -90  # no way from one to the other
    run = extend(two_modes, replace(run, ensembles=tuple(moved)), settings, 600, np.full(2, 10.0))
    chains = assess(run, settings)
    assert chains.left.sum() == 12
    assert np.all(chains.left[:, :3])
    assert not chains.converged
    assert any("12 of 128 left" in reason for reason in chains.reasons)
    assert np.all(np.abs(chains.thinned().points - 0.3) < 0.2)


def test_a_single_mode_of_two_is_sampled_as_one():
    chains = sample_mode(two_modes, np.full(2, 0.3), 4e-4 * np.eye(2), seed=6)
    assert chains.converged, chains.reasons
    assert chains.left.mean() <= 0.05
    check_moments(chains, np.full(2, 0.3), np.full(2, 0.02))


def test_a_stuck_walker_is_seen():
    rng = np.random.default_rng(0)
    chain, log_prob = rng.normal(size=(4, 100, 16, 2)), rng.normal(size=(4, 100, 16))
    chain[1, :, 3], log_prob[1, :, 3] = 0.2, 0.1
    chain[2, :, 5] += 6.0
    stuck, left = stuck_walkers(chain, log_prob, 2.0, SampleSettings())
    assert np.argwhere(stuck).tolist() == [[1, 3]]
    assert np.argwhere(left).tolist() == [[2, 5]]


def test_same_seed_same_numbers_other_seed_other_numbers():
    few = SampleSettings(max_steps=50)
    np.random.seed(0)  # noqa: NPY002 - the global generator must not matter
    first = sample_mode(gaussian, np.full(D, 0.5), COVARIANCE, 7, few)
    np.random.seed(1)  # noqa: NPY002
    again = sample_mode(gaussian, np.full(D, 0.5), COVARIANCE, 7, few)
    other = sample_mode(gaussian, np.full(D, 0.5), COVARIANCE, 8, few)
    np.testing.assert_array_equal(first.chain, again.chain)
    assert np.all(first.chain[:, -1] != other.chain[:, -1])
    assert np.all(first.chain[0, -1] != first.chain[1, -1])


def test_too_few_steps_are_not_called_converged_and_say_why():
    chains = sample_mode(gaussian, np.full(D, 0.5), COVARIANCE, 9, SampleSettings(max_steps=60))
    assert not chains.converged
    assert chains.steps == 60
    assert any("fewer than 100 tau" in reason for reason in chains.reasons)


def test_every_requirement_of_the_stop_rule_is_met_or_named():
    settings, centre = SampleSettings(), np.full(2, 0.3)
    run = produce(
        begin(two_modes, StudentTMixture.single(centre, 4e-4 * np.eye(2), 5.0), np.random.SeedSequence(5), settings),
        settings,
    )
    run = extend(two_modes, run, settings, 500, np.full(2, np.inf))
    tau = assess(run, settings).tau
    assert assess(replace(run, tau=tau), settings).converged
    assert assess(replace(run, tau=2.0 * tau), settings).converged
    assert assess(replace(run, tau=tau / 1.009), settings).converged
    cases = [
        (replace(run, tau=tau * [1.0, 0.98]), settings, "tau still grows, by 2.0 % between checks"),
        (replace(run, tau=tau, ensembles=run.ensembles[:3]), settings, "3 ensembles are fewer than 4"),
        (replace(run, tau=tau), replace(settings, min_ess=1e9), "ESS is"),
        (replace(run, tau=tau), replace(settings, max_r_hat=1.0 - 1e-3), "R-hat is"),
        (replace(run, tau=tau), replace(settings, tau_multiple=1000.0), "steps are fewer than 1000 tau"),
    ]
    for state, rule, reason in cases:
        chains = assess(state, rule)
        assert not chains.converged
        assert len(chains.reasons) == 1
        assert reason in chains.reasons[0]


def test_failed_simulations_and_the_outside_count_as_zero_density():
    def target(x):
        assert np.all((x >= 0) & (x <= 1))
        return np.where(x[:, 0] > 0.5, np.nan, -0.5 * ((x[:, 0] - 0.5) / 0.1) ** 2)

    chains = sample_mode(target, [0.5], [[0.01]], seed=10)
    assert chains.converged, chains.reasons
    exact = stats.truncnorm(-5, 0, 0.5, 0.1)
    check_moments(chains, exact.mean(), exact.std())
    with pytest.raises(InputError, match="posterior is zero"):
        sample_mode(lambda x: np.full(len(x), np.nan), [0.5], [[0.01]], seed=10)


def test_many_parameters_get_more_walkers():
    assert SampleSettings().walkers_for(12) == 24
    assert SampleSettings().walkers_for(13) == 48
