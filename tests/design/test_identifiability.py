"""Verdicts from known precisions, and estimates confined by bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from mofit.experimental_design.criteria import Criterion, sd_over_samples
from mofit.experimental_design.identifiability import (
    COMBINATION,
    IDENTIFIABLE,
    NOT,
    ONE_SIDED,
    SETTINGS,
    VERDICTS,
    balanced_draws,
    bounded_minima,
    bounded_sd,
    condition_indices,
    correlated_parameters,
    identifiability,
)
from mofit.parameters import Parameter, ParameterSpace

SPACE = ParameterSpace(
    (
        Parameter("a", "N/m", 1.0, 100.0, 10.0, "log"),
        Parameter("b", "N s/m", 0.0, 10.0, 5.0),
        Parameter("c", "1", -1.0, 1.0, 0.0),
    )
)


def words(precision, values=(10.0, 5.0, 0.0)) -> list[str]:
    found = identifiability(np.asarray(precision, dtype=float)[None], np.array([values]), SPACE)
    return [VERDICTS[word] for word in found.verdicts[0]]


def test_each_verdict_from_a_precision_that_deserves_it() -> None:
    sharp, blunt = 1 / 0.02**2, 1 / 0.3**2
    assert words(np.diag([sharp, sharp, sharp])) == [IDENTIFIABLE] * 3
    assert words(np.diag([sharp, 0.0, blunt])) == [IDENTIFIABLE, NOT, NOT]
    # only the sum of the first two is known
    assert words(np.array([[sharp, sharp, 0], [sharp, sharp, 0], [0, 0, sharp]])) == [
        COMBINATION, COMBINATION, IDENTIFIABLE,
    ]  # fmt: skip
    # too wide to be called known, but far from the lower bound
    assert words(np.diag([sharp, 1 / 0.25**2, sharp]), (10.0, 8.0, 0.0))[1] == ONE_SIDED
    # an estimate that its bound stops scatters little, and is not known for that
    assert words(np.diag([sharp, 1 / 0.3**2, sharp]), (10.0, 9.9, 0.0))[1] == ONE_SIDED
    assert np.all(identifiability(np.full((1, 3, 3), np.nan), np.array([[10.0, 5.0, 0.0]]), SPACE).verdicts == -1)


def test_relative_and_absolute_thresholds() -> None:
    # b = 5 of 10: half the box; a quarter of the value is an eighth of the box
    assert words(np.diag([1e6, 1 / 0.12**2, 1e6]))[1] == IDENTIFIABLE
    assert words(np.diag([1e6, 1 / 0.13**2, 1e6]))[1] != IDENTIFIABLE
    # c = 0: only the share of the box counts
    assert words(np.diag([1e6, 1e6, 1 / 0.049**2]))[2] == IDENTIFIABLE
    assert words(np.diag([1e6, 1e6, 1 / 0.051**2]))[2] != IDENTIFIABLE


def test_relative_standard_deviations_in_both_scales() -> None:
    found = identifiability(np.diag([1e4, 1e4, 1e4])[None], np.array([[10.0, 5.0, 0.5]]), SPACE)
    np.testing.assert_allclose(found.relative_sd[0], [0.01 * np.log(100), 0.01 * 10 / 5, 0.01 * 2 / 0.5], rtol=1e-4)
    np.testing.assert_allclose(found.variance_inflation[0], 1.0, rtol=1e-4)


def test_correlated_parameters_are_those_that_help() -> None:
    root = np.array([[50.0, 50.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 50.0]])
    found = identifiability((root.T @ root)[None], np.array([[10.0, 5.0, 0.0]]), SPACE)
    assert correlated_parameters(found.covariance[0], 0, 1 / np.log(100)) == [1]
    assert len(correlated_parameters(found.covariance[0], 2, 1.0)) == 1  # the most helpful, though none is needed


def test_condition_indices_of_known_collinearity() -> None:
    correlation = 0.98
    matrix = np.array([[4.0, 2 * correlation], [2 * correlation, 1.0]])
    np.testing.assert_allclose(condition_indices(matrix), [1.0, np.sqrt(1.98 / 0.02)])


def test_estimates_far_from_bounds_have_the_inverse_precision() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 3)) * 100
    expected = np.sqrt(np.diag(np.linalg.inv(root.T @ root)))
    np.testing.assert_allclose(bounded_sd(root.T @ root, np.full(3, -0.5), np.full(3, 0.5)), expected, rtol=1e-6)


def test_an_estimate_that_knows_nothing_ends_at_its_bounds_and_moves_others() -> None:
    # the sum of both is known to 0.01; the first alone not at all
    precision = np.array([[1e4, 1e4], [1e4, 1e4 + 1e-3]])
    found = bounded_sd(precision, np.full(2, -0.5), np.full(2, 0.5))
    np.testing.assert_allclose(found, 0.5, rtol=0.05)
    silent = bounded_sd(np.diag([0.0, 1e4]), np.array([-0.2, -0.5]), np.array([0.8, 0.5]))
    np.testing.assert_allclose(silent, [0.5, 0.01], rtol=0.05)


def test_a_clipped_gaussian_has_the_spread_of_the_closed_form() -> None:
    from scipy.stats import norm

    # sd 0.3, bounds at ±0.3: variance of a Gaussian clipped at one standard deviation
    inner = 1 - 2 * norm.sf(1) - 2 * norm.pdf(1)
    expected = 0.3 * np.sqrt(inner + 2 * norm.sf(1))
    found = bounded_sd(np.array([[1 / 0.09]]), np.array([-0.3]), np.array([0.3]))
    np.testing.assert_allclose(found, expected, rtol=0.04)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_bounded_estimates_agree_with_a_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 3)) * 10.0 ** rng.uniform(-0.5, 1, 3)
    precision = root.T @ root
    low, high = -rng.uniform(0.05, 0.5, 3), rng.uniform(0.05, 0.5, 3)
    gradients = balanced_draws(3, 20)[:10] @ np.linalg.cholesky(precision).T
    found = bounded_minima(precision, gradients, low, high, [0, 1, 2])
    upper = np.linalg.cholesky(precision).T
    for gradient, own in zip(gradients, found, strict=True):
        peer = lsq_linear(upper, np.linalg.solve(upper.T, gradient), (low, high), tol=1e-12)
        value = 0.5 * own @ precision @ own - gradient @ own
        other = 0.5 * peer.x @ precision @ peer.x - gradient @ peer.x
        assert value <= other + 1e-6 * max(abs(other), 1.0)
        assert np.all((own >= low - 1e-6) & (own <= high + 1e-6))


@pytest.mark.parametrize("size", [1, 3, 8])
def test_draws_are_balanced(size: int) -> None:
    draws = balanced_draws(size, SETTINGS.draws)
    np.testing.assert_allclose(draws.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(draws.T @ draws / len(draws), np.eye(size), atol=1e-12)


def test_standard_deviations_are_summed_up_as_the_criterion_is():
    """A diagonal precision: the criterion of its second parameter is that parameter's standard deviation."""
    sds = np.array([[0.1, 0.02], [0.1, 0.5], [0.1, 0.03]])
    precision = np.stack([np.diag(own**-2.0) for own in sds])
    for aggregate, expected in (("mean", np.cbrt(0.02 * 0.5 * 0.03)), ("worst", 0.5)):
        found = Criterion("c", np.array([[0.0, 1.0]]), aggregate)
        assert sd_over_samples(sds[:, 1], aggregate) == pytest.approx(expected)
        assert found.shown(float(found(precision))) == pytest.approx(expected)
