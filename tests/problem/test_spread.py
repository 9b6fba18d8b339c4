"""The posterior that is sampled: derivatives, and what it makes of colour and gap."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.bundled import bundled_campaign
from mofit.calibration import calibrate, calibrated_values
from mofit.campaign_file import read_campaign
from mofit.few_steps import in_few_steps
from mofit.library import find_model
from mofit.one_period import in_one_period
from mofit.posing import choose_tests, dynamic_problem
from mofit.refine import merge, refine
from mofit.score import score
from mofit.settings import Settings, free_space
from mofit.spread import spread_problem, spread_problems


@pytest.fixture(scope="module")
def fitted():
    """The bundled campaign's sine tests with steady state and spring held, and their minimum."""
    campaign, model, settings = read_campaign(bundled_campaign()), find_model("maxwell_tyre"), Settings(jobs=1)
    space = free_space(model, settings)
    calibrations, _ = calibrate(model, campaign, space, seed=0, jobs=1)
    assert set(calibrated_values(calibrations)) >= {"c_y", "p_y"}
    selected = campaign.select(choose_tests(model, campaign, ()))
    problem = dynamic_problem(model, selected, space, calibrations, settings)
    point = merge(refine(problem.evaluate, problem.space.to_unit(problem.space.nominal)[None]))[0].point
    problem = problem.with_noise_at(point)
    return problem, merge(refine(problem.evaluate, point[None]))[0].point


@pytest.mark.parametrize("number", [0, 1], ids=["with gap", "noise alone"])
def test_derivatives(fitted, number):
    problem, point = fitted
    wide = spread_problems(problem, point)[number]
    u = point + 0.002 * np.array([[1.0, -1.0, 0.5], [-0.5, 0.3, 1.0]])
    value, gradient, hessian = wide.evaluate(u)
    np.testing.assert_allclose(value, -wide.log_posterior(u), rtol=1e-12)
    step = 1e-6
    for k, move in enumerate(step * np.eye(3)):
        central = (wide.evaluate(u + move)[0] - wide.evaluate(u - move)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[:, k], central, rtol=1e-4, atol=1e-4 * np.abs(gradient).max())
    assert np.all(np.linalg.eigvalsh(hessian) > 0)


def test_hidden_spectrum_is_a_gap_that_widens_the_posterior(fitted):
    problem, point = fitted
    wide, narrow = (np.sqrt(np.diag(np.linalg.inv(own.hessian))) for own in spread_problems(problem, point))
    assert np.all(wide > 2 * narrow)
    found = score(problem, point)
    assert found.gap_squares[0] > 0
    assert found.gap_freedom == 2 * len(problem.tests) - 3


def test_log_posterior_is_the_problems_own_at_the_minimum(fitted):
    problem, point = fitted
    wide = spread_problem(problem, point)
    assert wide.log_posterior(point[None]) == pytest.approx(problem.log_posterior(point[None]))
    assert wide.log_posterior(np.full((1, 3), 1.5))[0] == -np.inf


def test_few_steps_say_what_many_do(fitted):
    """Coarse integration, made right at the minimum, gives the same posterior around it."""
    problem, point = fitted
    covariance = np.linalg.inv(spread_problem(problem, point).hessian)
    sd = np.sqrt(np.diag(covariance))
    wide = spread_problem(problem.near(point[None], sd), point)
    quick = wide.around(point, sd)
    many, few = (own.problem.simulator.rules for own in (wide, quick))
    assert max(rule.rungs[0].steps for rule in few) < max(rule.rungs[0].steps for rule in many)
    u = np.clip(np.random.default_rng(2).multivariate_normal(point, 2 * covariance, 40), 0, 1)
    np.testing.assert_allclose(quick.log_posterior(u), wide.log_posterior(u), atol=0.02)
    assert quick.log_posterior(point[None])[0] == pytest.approx(wide.log_posterior(point[None])[0], abs=1e-9)


def test_one_period_says_what_all_do(fitted):
    """Folded data give the same squares but for a constant, from a fraction of the samples; transients stay."""
    problem, point = fitted
    sd = np.sqrt(np.diag(np.linalg.inv(spread_problem(problem, point).hessian)))
    near = problem.near(point[None], sd)
    cut = in_one_period(near, point, sd)
    assert sum(drive.samples for drive in cut.drives) < 0.5 * sum(drive.samples for drive in near.drives)
    for own, whole in zip(cut.drives, near.drives, strict=True):
        assert own.samples * own.step > 2 / 4  # the first judged period of the quickest sine is never settled
        np.testing.assert_allclose(own.weights.sum(), whole.weights.sum())
    u = point + sd * np.random.default_rng(3).uniform(-2, 2, (20, 3))
    change = [own.squares(u) - own.squares(point[None]) for own in (cut, near)]
    np.testing.assert_allclose(change[0], change[1], rtol=1e-3)


def test_a_response_that_never_repeats_is_kept_whole(fitted):
    problem, point = fitted
    near = problem.near(point[None], np.full(3, 0.01))
    records = tuple(replace(record, period=None) for record in near.records)
    kept = in_one_period(replace(near, records=records), point, np.full(3, 0.01))
    assert kept.drives == near.drives
    # one whose samples never meet the same phase again
    records = tuple(replace(record, period=record.period * 1.01234) for record in near.records)
    kept = in_one_period(replace(near, records=records), point, np.full(3, 0.01))
    assert kept.drives == near.drives


def test_few_steps_are_refused_where_their_fault_varies(fitted):
    problem, point = fitted
    values = problem.full(point[None])[0]
    box = np.sort([0.9 * values, 1.1 * values], axis=0)
    strict = replace(problem, simulator=problem.simulator.within((box[0], box[1]), 1e-8))
    assert in_few_steps(strict, point, np.full(3, 0.02)) is strict
