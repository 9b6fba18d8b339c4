"""Hypervolume against sets whose volume is known."""

import numpy as np
import pytest

from mofit.optimize.pareto_front import hypervolume, hypervolume_history


def test_two_points_in_the_plane():
    points = np.array([[0.0, 0.5], [0.5, 0.0], [0.9, 0.9]])
    assert hypervolume(points, np.zeros(2), np.ones(2)) == pytest.approx(0.75)


def test_is_relative_to_the_box():
    points = np.array([[10.0, 1.5], [15.0, 1.0]])
    assert hypervolume(points, np.array([10.0, 1.0]), np.array([20.0, 2.0])) == pytest.approx(0.75)


@pytest.mark.parametrize("dimension", [2, 5, 9])
def test_staircase_of_many_points(dimension):
    # one point has volume prod(1 - f); points on an axis each add what their own coordinate leaves
    edge = 1 - 0.5 * np.eye(dimension)
    assert hypervolume(edge * 0.8, np.zeros(dimension), np.ones(dimension)) == pytest.approx(
        0.2**dimension + dimension * 0.4 * 0.2 ** (dimension - 1), rel=1e-9
    )


def test_approximation_of_many_objectives_is_close_to_the_exact_volume():
    # the corners of a simplex: the union's volume by inclusion and exclusion of boxes sharing f = max
    rng = np.random.default_rng(3)
    points = rng.uniform(0.2, 0.9, (60, 6))
    samples = rng.uniform(size=(400_000, 6))
    dominated = np.zeros(len(samples), dtype=bool)
    for point in points:
        dominated |= np.all(samples >= point, axis=1)
    assert hypervolume(points, np.zeros(6), np.ones(6)) == pytest.approx(dominated.mean(), abs=5e-3)


def test_failed_and_poor_points_count_nothing():
    points = np.array([[0.5, 0.5], [np.nan, 0.0], [2.0, 0.0]])
    assert hypervolume(points, np.zeros(2), np.ones(2)) == pytest.approx(0.25)
    assert hypervolume(points[1:], np.zeros(2), np.ones(2)) == 0


def test_history_grows(rng):
    values = rng.uniform(size=(100, 3))
    history = hypervolume_history(values, np.array([10, 50, 100]))
    assert np.all(np.diff(history) >= 0)
    assert history[-1] > history[0]
