"""The surrogate search and its Gaussian process, against known answers."""

import numpy as np
import pytest

from benchmarks.rastrigin import Rastrigin, found
from mofit.errors import InputError
from mofit.optimize.gaussian_process import GaussianProcess, fit_lengths, negative_log_posterior
from mofit.optimize.searches.surrogate import SurrogateSettings, search


def no_gradients(_):
    raise AssertionError("the surrogate search takes no gradients")


@pytest.fixture
def seen(rng):
    points = rng.uniform(size=(40, 2))
    values = np.stack([np.sin(6 * points[:, 0]) + points[:, 1], np.cos(5 * points[:, 1])], axis=1)
    return points, values


def test_process_goes_through_its_points_and_is_sure_there(seen):
    process = GaussianProcess(*seen, np.array([0.3, 0.4]))
    assert process.mean(seen[0]) == pytest.approx(seen[1], abs=1e-3)
    assert process.deviation(seen[0]).max() < 5e-3
    assert process.deviation(np.array([[30.0, 30.0]])) == pytest.approx(1.0)
    assert process.mean(np.array([[30.0, 30.0]]))[0] == pytest.approx(process.centre)


def test_process_is_that_of_the_textbook(seen, rng):
    # conditional mean by the plain formula with an explicit inverse
    points, values = seen
    lengths, u = np.array([0.3, 0.4]), rng.uniform(size=(5, 2))
    kernel = lambda a, b: np.exp(-0.5 * np.sum(((a[:, None] - b[None]) / lengths) ** 2, axis=-1))  # noqa: E731
    inverse = np.linalg.inv(kernel(points, points) + 1e-6 * np.eye(40))
    centre = inverse.sum(axis=0) @ values / inverse.sum()
    expected = centre + kernel(u, points) @ inverse @ (values - centre)
    assert GaussianProcess(points, values, lengths).mean(u) == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_slope_of_the_mean_matches_differences(seen, rng):
    process, u, step = GaussianProcess(*seen, np.array([0.3, 0.4])), rng.uniform(size=(6, 2)), 1e-5
    mean, slope = process.mean_and_slope(u)
    assert mean == pytest.approx(process.mean(u))
    for j in range(2):
        shift = step * np.eye(2)[j]
        assert slope[..., j] == pytest.approx(
            (process.mean(u + shift) - process.mean(u - shift)) / (2 * step), abs=1e-5
        )


def test_gradient_of_the_evidence_matches_differences(seen):
    points, values = seen
    squares = (points[:, None] - points[None]) ** 2
    at, step = np.log([0.25, 0.6]), 1e-5
    _, gradient = negative_log_posterior(at, squares, values)
    for j in range(2):
        shift = step * np.eye(2)[j]
        ends = [negative_log_posterior(at + sign * shift, squares, values)[0] for sign in (1, -1)]
        assert gradient[j] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)


def test_fitted_lengths_tell_a_rough_coordinate_from_a_flat_one(rng):
    points = rng.uniform(size=(60, 2))
    lengths = fit_lengths(points, np.sin(9 * points[:, :1]) + 0.1 * points[:, 1:], rng)
    assert lengths[0] < 0.4 < 1 < lengths[1]


@pytest.mark.parametrize("turned", [False, True])
def test_all_minima_of_rastrigin(turned):
    rng = np.random.default_rng(21)
    function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
    result = search(function.value, function.gradient, 2, rng)
    assert found(function.scaled(result.archived_points), function.minima, 0.05) == len(function.minima)
    assert result.evaluations <= 300
    assert len(result.archived) < 40


def test_several_objectives_failures_and_an_early_end():
    centres = np.array([[0.3, 0.3], [0.7, 0.6]])

    def objectives(u):
        values = np.sum((u[:, None] - centres) ** 2, axis=-1)
        values[u[:, 0] > 0.9] = np.nan
        return values

    result = search(
        objectives, no_gradients, 2, np.random.default_rng(3), SurrogateSettings(evaluations=150), weights=[1, 3]
    )
    assert result.archived_points[0] == pytest.approx([0.6, 0.525], abs=0.01)
    assert result.objectives[result.archived].min(axis=0) == pytest.approx([0, 0], abs=1e-3)
    assert result.evaluations < 150
    with pytest.raises(InputError, match="start points failed"):
        search(lambda u: np.full((len(u), 1), np.nan), no_gradients, 2, np.random.default_rng(0))
