"""The expected difference between models and the rejection probability, against simulated experiments."""

import numpy as np
import pytest

from mofit.diagnosis.expected_discrimination import linearise, rejection_probability

ODDS = 10.0


@pytest.mark.parametrize("known", [1.0, 30.0])
def test_the_difference_has_the_mean_and_variance_of_an_experiment(known: float) -> None:
    """Two linear models that share a parameter; the data are the first one's response, as far as it is known."""
    rng = np.random.default_rng(4)
    rows, repeated, trials = 40, 3, 20_000
    own, other = rng.normal(size=(rows, 3)), rng.normal(size=(rows, 2))
    other[:, 0] += own[:, 0]
    hessians = [known * np.diag([5.0, 200.0, 30.0]), known * np.diag([3.0, 80.0])]
    responses = [0.3 * rng.normal(size=rows), 0.3 * rng.normal(size=rows)]
    test = linearise(responses, [own, other], hessians, 20.0)

    slopes = [np.tile(one, (repeated, 1)) for one in (own, other)]
    covariances = [one @ np.linalg.inv(hessian) @ one.T for one, hessian in zip(slopes, hessians, strict=True)]
    costs = [np.linalg.inv(np.eye(repeated * rows) + covariance) for covariance in covariances]
    away = rng.normal(size=(trials, 3)) / np.sqrt(np.diag(hessians[0]))
    measured = away @ slopes[0].T + rng.normal(size=(trials, repeated * rows))
    rest = measured + np.tile(responses[0] - responses[1], repeated)
    lead = np.sum((rest @ costs[1]) * rest, axis=1) - np.sum((measured @ costs[0]) * measured, axis=1)

    mean, variance = test.discrimination(0, 1, repeated * 20.0)
    assert mean == pytest.approx(np.mean(lead), abs=4 * np.std(lead) / np.sqrt(trials))
    assert variance == pytest.approx(np.var(lead), rel=0.08)


def test_a_longer_test_gains_less_and_less_where_the_wrong_model_adapts() -> None:
    ramp = np.linspace(-1, 1, 50)[:, None]
    test = linearise([2.0 * ramp[:, 0], 0 * ramp[:, 0]], [ramp, ramp], [np.eye(1), np.eye(1)], 1.0)
    gains = [test.discrimination(0, 1, seconds)[0] for seconds in (0.1, 1.0, 10.0, 100.0)]
    assert 0 < gains[0] < gains[1] < gains[2] < gains[3] < 4.0 + 1e-9
    assert gains[1] < 5 * gains[0]


@pytest.mark.parametrize(("distance", "likely"), [(4.0, (0.5, 0.5)), (5.0, (0.2, 0.8)), (3.0, (0.9, 0.1))])
def test_a_model_is_ruled_out_as_often_as_in_an_experiment(distance: float, likely: tuple[float, float]) -> None:
    """Two means, white noise."""
    noise = np.random.default_rng(1).standard_normal(200_000)
    lead = np.array([[np.inf, distance**2], [distance**2, np.inf]])
    expected = rejection_probability(lead, np.full((2, 2), 4 * distance**2), np.array(likely), ODDS)
    for right, sign in ((0, 1.0), (1, -1.0)):
        measured = noise if right == 0 else distance + noise
        # log likelihood of mean 0 over that of the other
        ahead = sign * 0.5 * ((measured - distance) ** 2 - measured**2) + np.log(likely[right] / likely[1 - right])
        assert expected[right, 1 - right] == pytest.approx(np.mean(ahead > np.log(ODDS)), abs=0.004)
        assert expected[right, right] == 1


def test_a_test_without_information_leaves_what_is_ruled_out_already() -> None:
    found = rejection_probability(np.zeros((3, 2, 2)), np.zeros((3, 2, 2)), np.array([0.95, 0.05]), ODDS)
    assert found.shape == (3, 2, 2)
    assert found[:, 0, 1] == pytest.approx(1)
    assert found[:, 1, 0] == pytest.approx(0)
