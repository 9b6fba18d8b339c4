"""The posterior that is sampled: derivatives, and what it makes of colour and gap."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import bundled_campaign, read_campaign
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.optimize import merge, refine
from mofit.problem import adjusted_posterior
from mofit.problem.local_model import coarse_steps, fold_periods, star


@pytest.fixture(scope="module")
def fitted():
    """The bundled campaign's sine tests with steady state and spring held, and their minimum."""
    campaign, model, settings = read_campaign(bundled_campaign()), find_model("maxwell_tyre"), Settings(jobs=1)
    setup = set_up_problem(model, campaign, settings)
    assert {name for calibration in setup.calibrations for name in calibration.values} >= {"c_y", "p_y"}
    problem = setup.searched
    point = merge(refine(problem.evaluate, problem.space.to_unit(problem.space.nominal)[None]))[0].point
    problem = problem.with_noise_at(point)
    return problem, merge(refine(problem.evaluate, point[None]))[0].point


def folded(problem, point, sd, periods=None):
    """Simulator and tests cut to one period that stands for all, around a point."""
    periods = periods or [analysis.period for analysis in problem.signals]
    return fold_periods(problem.simulator, problem.experiments, periods, problem.layout.full(star(point, sd)))


@pytest.mark.parametrize("with_gap", [True, False], ids=["with gap", "noise alone"])
def test_derivatives(fitted, with_gap):
    problem, point = fitted
    wide = adjusted_posterior(problem, point, with_gap=with_gap)
    u = point + 0.002 * np.array([[1.0, -1.0, 0.5], [-0.5, 0.3, 1.0]])
    value, gradient, hessian = wide.evaluate(u)
    np.testing.assert_allclose(value, -wide.log_posterior(u), rtol=1e-12)
    np.testing.assert_allclose(value, wide.value(u), rtol=1e-12)
    step = 1e-6
    for k, move in enumerate(step * np.eye(3)):
        central = (wide.evaluate(u + move)[0] - wide.evaluate(u - move)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[:, k], central, rtol=1e-4, atol=1e-4 * np.abs(gradient).max())
    assert np.all(np.linalg.eigvalsh(hessian) > 0)


def test_hidden_spectrum_is_a_gap_that_widens_the_posterior(fitted):
    problem, point = fitted
    adjusted = adjusted_posterior(problem, point)
    wide, narrow = (np.sqrt(np.diag(np.linalg.inv(own))) for own in (adjusted.hessian, adjusted.noise_hessian))
    assert np.all(wide > 2 * narrow)
    np.testing.assert_array_equal(adjusted.noise_hessian, adjusted_posterior(problem, point, with_gap=False).hessian)
    found = problem.score(point)
    assert found.gap_squares[0] > 0
    assert found.gap_freedom == 2 * len(problem.tests) - 3


def test_log_posterior_is_the_problems_own_at_the_minimum(fitted):
    problem, point = fitted
    wide = adjusted_posterior(problem, point)
    assert wide.log_posterior(point[None]) == pytest.approx(problem.log_posterior(point[None]))
    assert wide.log_posterior(np.full((1, 3), 1.5))[0] == -np.inf


def test_few_steps_say_what_many_do(fitted):
    """Coarse integration, made right at the minimum, gives the same posterior around it."""
    problem, point = fitted
    covariance = np.linalg.inv(adjusted_posterior(problem, point).hessian)
    sd = np.sqrt(np.diag(covariance))
    wide = adjusted_posterior(problem.near(point[None], sd), point)
    quick = wide.local(point, sd)
    many, few = (own.problem.simulator.rules for own in (wide, quick))
    assert max(rule.levels[0].steps for rule in few) < max(rule.levels[0].steps for rule in many)
    u = np.clip(np.random.default_rng(2).multivariate_normal(point, 2 * covariance, 40), 0, 1)
    np.testing.assert_allclose(quick.log_posterior(u), wide.log_posterior(u), atol=0.02)
    assert quick.log_posterior(point[None])[0] == pytest.approx(wide.log_posterior(point[None])[0], abs=1e-9)


def test_one_period_says_what_all_do(fitted):
    """Folded data give the same squares but for a constant, from a fraction of the samples; transients stay."""
    problem, point = fitted
    sd = np.sqrt(np.diag(np.linalg.inv(adjusted_posterior(problem, point).hessian)))
    near = problem.near(point[None], sd)
    simulator, experiments = folded(near, point, sd)
    assert sum(own.samples for own in experiments) < 0.5 * sum(own.samples for own in near.experiments)
    for own, whole in zip(experiments, near.experiments, strict=True):
        assert own.samples * own.step > 2 / 4  # the first judged period of the quickest sine is never settled
        np.testing.assert_allclose(own.weights.sum(), whole.weights.sum())
    u = point + sd * np.random.default_rng(3).uniform(-2, 2, (20, 3))
    cut = replace(near, simulator=simulator, experiments=experiments)
    change = [own.squares(u) - own.squares(point[None]) for own in (cut, near)]
    np.testing.assert_allclose(change[0], change[1], rtol=1e-3)


def test_a_response_that_never_repeats_is_kept_whole(fitted):
    problem, point = fitted
    near = problem.near(point[None], np.full(3, 0.01))
    # without a period, or with one whose samples never meet the same phase again
    for periods in ([None] * len(near.tests), [1.01234 * analysis.period for analysis in near.signals]):
        _, kept = folded(near, point, np.full(3, 0.01), periods)
        assert kept == near.experiments


def test_as_few_steps_as_keep_the_defect_constant_are_taken(fitted):
    problem, point = fitted
    values = problem.layout.full(point[None])[0]
    box = np.sort([0.9 * values, 1.1 * values], axis=0)
    around = problem.layout.full(star(point, np.full(3, 0.02)))
    chosen = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        strict = problem.simulator.within((box[0], box[1]), tolerance)
        quick, experiments = coarse_steps(strict, problem.experiments, around)
        chosen.append(quick.steps or np.inf)
        assert (quick.steps is None) == (experiments == problem.experiments)
        for ours, exact in zip(quick.simulate(around), strict.simulate(around), strict=True):
            change = (ours - ours[0]) - (exact - exact[0])
            assert np.abs(change).max() <= 1.001 * tolerance * np.ptp(exact[0])
    assert chosen[0] < min(chosen[1:])


@pytest.mark.slow
def test_few_steps_are_refused_where_their_defect_varies(fitted):
    problem, point = fitted
    values = problem.layout.full(point[None])[0]
    box = np.sort([0.9 * values, 1.1 * values], axis=0)
    strict = problem.simulator.within((box[0], box[1]), 1e-13)
    around = problem.layout.full(star(point, np.full(3, 0.02)))
    assert coarse_steps(strict, problem.experiments, around) == (strict, problem.experiments)
