"""MLSL on functions whose minima are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.rastrigin import Rastrigin, found
from mofit.errors import InputError
from mofit.optimize.minima_archive import expected_undiscovered
from mofit.optimize.searches.mlsl import MlslSettings, search


def both(value, slope):
    """Objectives and gradients from functions of points (N, d) to (N,) and (N, d)."""
    return lambda u: value(u)[:, None], lambda u: (value(u)[:, None], slope(u)[:, None, :])


def bowls(centres, weights=1.0):
    """One quadratic objective per centre."""

    def value(u):
        return np.sum(weights * (u[:, None] - centres) ** 2, axis=-1)

    return value, lambda u: (value(u), 2 * weights * (u[:, None] - centres))


def wells(centres, depths):
    """Minimum of bowls: a basin per centre, kinks between them."""
    centres, depths = np.asarray(centres), np.asarray(depths)

    def value(u):
        return np.min(np.sum((u[:, None] - centres) ** 2, axis=-1) - depths, axis=1)

    def slope(u):
        nearest = np.argmin(np.sum((u[:, None] - centres) ** 2, axis=-1) - depths, axis=1)
        return 2 * (u - centres[nearest])

    return both(value, slope)


@pytest.mark.parametrize("turned", [False, True])
def test_all_minima_of_rastrigin(turned):
    for seed in range(3):
        rng = np.random.default_rng(100 + seed)
        function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
        result = search(function.value, function.gradient, 2, rng, MlslSettings(undiscovered=None))
        answers = function.scaled(result.archived_points)
        assert found(answers, function.minima[:1], 0.05) == 1
        assert found(answers, function.minima, 0.05) >= len(function.minima) - 1
        assert result.evaluations == 600
        assert 0 < result.gradients < 600


def test_budget_counts_values_and_gradients():
    seen = [0, 0]
    value, gradient = bowls(np.array([[0.3, 0.4, 0.5]]))

    def objectives(u):
        seen[0] += len(u)
        return value(u)

    def gradients(u):
        seen[1] += len(u)
        return gradient(u)

    result = search(objectives, gradients, 3, np.random.default_rng(0), MlslSettings(evaluations=70, undiscovered=None))
    assert sum(seen) == result.evaluations == len(result.points) == 70
    assert seen[1] == result.gradients


def test_one_bowl_is_one_minimum_and_soon_done():
    settings = MlslSettings(final_tolerance=1e-7, undiscovered=0.1)
    result = search(*bowls(np.array([[0.31, 0.77]])), 2, np.random.default_rng(1), settings)
    assert len(result.archived) == 1
    assert result.archived_points[0] == pytest.approx([0.31, 0.77], abs=1e-6)
    assert result.expected_undiscovered < 0.1
    assert result.evaluations < 200


def test_minimum_in_a_corner_and_on_an_edge():
    value, slope = (lambda u: u[:, 0] - u[:, 1]), (lambda u: np.tile([1.0, -1.0], (len(u), 1)))
    corner = search(*both(value, slope), 2, np.random.default_rng(2))
    assert len(corner.archived) == 1
    assert corner.archived_points[0] == pytest.approx([0, 1], abs=2e-3)
    edge = search(*bowls(np.array([[-0.4, 0.6]])), 2, np.random.default_rng(3))
    assert edge.archived_points == pytest.approx(np.array([[0, 0.6]]), abs=3e-3)


def test_two_equal_minima_stay_two():
    result = search(*wells([[0.2, 0.3], [0.8, 0.6]], [0.0, 0.0]), 2, np.random.default_rng(4))
    assert result.archived_points[np.argsort(result.archived_points[:, 0])] == pytest.approx(
        np.array([[0.2, 0.3], [0.8, 0.6]]), abs=2e-3
    )


def test_a_flat_valley_is_not_cut_into_many():
    # the minimum is the line u_0 = 0.5; its floor rises by far less than any step can tell
    value = lambda u: (u[:, 0] - 0.5) ** 2 + 1e-9 * u[:, 1]  # noqa: E731
    slope = lambda u: np.stack([2 * (u[:, 0] - 0.5), np.full(len(u), 1e-9)], axis=1)  # noqa: E731
    result = search(*both(value, slope), 2, np.random.default_rng(5))
    assert len(result.archived) <= 2


def test_failed_points_are_avoided():
    def value(u):
        return np.where(u[:, 0] < 0.4, np.nan, np.sum((u - 0.6) ** 2, axis=1))

    result = search(*both(value, lambda u: 2 * (u - 0.6)), 2, np.random.default_rng(6))
    assert result.archived_points[0] == pytest.approx([0.6, 0.6], abs=2e-3)
    with pytest.raises(InputError, match="start points failed"):
        search(*both(lambda u: np.full(len(u), np.nan), np.zeros_like), 2, np.random.default_rng(7))


def test_each_objective_alone_and_what_lies_between():
    centres = np.array([[0.2, 0.2], [0.8, 0.2], [0.5, 0.8]])
    result = search(*bowls(centres), 2, np.random.default_rng(8), weights=[1, 1, 2])
    points = result.archived_points
    assert points[0] == pytest.approx([0.5, 0.5], abs=3e-3)
    assert np.array(sorted(points[1:].tolist())) == pytest.approx(np.array(sorted(centres.tolist())), abs=3e-3)
    # the Pareto set is the triangle of the centres
    front = result.points[result.front]
    corners = np.column_stack([centres, np.ones(3)])
    shares = np.linalg.solve(corners.T, np.column_stack([front, np.ones(len(front))]).T)
    assert np.mean(shares.min(axis=0) > -0.02) > 0.9
    assert len(front) > 150


def test_same_seed_same_points():
    function = Rastrigin.plain()
    first, again, other = (
        search(function.value, function.gradient, 2, np.random.default_rng(seed)).points for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:20], other[:20])


def test_expected_undiscovered_minima_are_those_of_boender_and_rinnooy_kan():
    # their posterior expectation of the number of minima, w (n - 1) / (n - w - 2)
    assert expected_undiscovered(100, 5) == pytest.approx(5 * 99 / 93 - 5)
    assert expected_undiscovered(7, 5) == np.inf


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0.1, 50))
@settings(max_examples=25, deadline=None)
def test_any_bowl_is_found_to_its_bottom(x, y, stretch):
    value, gradient = bowls(np.array([[x, y]]), np.array([1.0, stretch]))
    result = search(value, gradient, 2, np.random.default_rng(0), MlslSettings(evaluations=200))
    assert result.archived_points[0] == pytest.approx([x, y], abs=0.01)


def test_after_many_evaluations_the_best_points_alone_start():
    chosen = MlslSettings(start_share=1.0, late_share=0.1, late=50_000)
    assert [chosen.start_share_after(used, 0.02) for used in (0, 49_999, 50_000)] == [1.0, 1.0, 0.1]
    assert chosen.start_share_after(50_000, 0.8) == 0.8
    assert MlslSettings(start_share=0.05).start_share_after(60_000, 0.5) == 0.05
