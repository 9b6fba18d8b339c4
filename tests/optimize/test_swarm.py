"""The fireflies: whom they see, where they fly, which clusters they form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.errors import InputError
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.swarm import SwarmSettings, cluster_centres, fly

CENTRES = np.array([[0.2, 0.3], [0.7, 0.2], [0.5, 0.8]])


def three_tests(u):
    """One objective per centre."""
    return np.linalg.norm(u[:, None] - CENTRES, axis=-1)


def flown(settings, count=64, objectives=three_tests, budget=10_000, seed=0):
    rng = np.random.default_rng(seed)
    log = EvaluationLog(objectives, lambda u: pytest.fail("no gradients"), 2, budget)
    rows, values = log.evaluate(rng.random((settings.candidates * count, 2)))
    weights = np.full(values.shape[1], 1 / values.shape[1])
    return log, fly(log, rows, weights, rng, settings)


def test_without_random_step_every_firefly_flies_to_the_centre_of_its_cluster():
    log, swarm = flown(SwarmSettings(moves=1, alpha=0.0, gamma=0.0))
    first, after = swarm.generations
    points = log.points[swarm.sample]
    neighbours = round(SwarmSettings().neighbours * np.log(len(points)))
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    for i, direction in enumerate(swarm.directions):
        dark, centre = three_tests(points) @ direction, first[i]
        while True:  # from neighbour to brighter neighbour
            near = np.argsort(distance[centre])[1 : neighbours + 1]
            brighter = [j for j in near if dark[j] < dark[centre]]
            if not brighter:
                break
            centre = brighter[0]
        assert log.points[after[i]] == pytest.approx(points[centre])


def test_every_firefly_starts_at_the_brightest_point_that_none_before_it_took():
    log, swarm = flown(SwarmSettings(moves=0))
    values, free = log.values, set(swarm.sample.tolist())
    for row, direction in zip(swarm.generations[0], swarm.directions, strict=True):
        assert values[row] @ direction == min(values[k] @ direction for k in free)
        free.remove(int(row))


def test_attraction_falls_with_distance():
    log, swarm = flown(SwarmSettings(moves=1, alpha=0.0, gamma=5.0, beta=0.5))
    full, whole = flown(SwarmSettings(moves=1, alpha=0.0, gamma=0.0))
    before, after = log.points[swarm.generations]
    _, target = full.points[whole.generations]
    gap = target - before
    expected = before + 0.5 * np.exp(-5.0 * np.linalg.norm(gap, axis=1, keepdims=True)) * gap
    assert after == pytest.approx(expected)


def test_the_swarm_holds_the_minima_of_single_objectives_and_of_the_mean():
    log, swarm = flown(SwarmSettings(moves=8, alpha=0.5))
    values = log.values[swarm.rows]
    assert np.all(values.min(axis=0) < 0.05)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 201)] * 2), axis=-1).reshape(-1, 2)
    assert values.mean(axis=1).min() == pytest.approx(three_tests(grid).mean(axis=1).min(), abs=5e-3)
    only_mean, alike = flown(SwarmSettings(moves=8, alpha=0.5, joint=1.0))
    last, others = log.values[swarm.generations[-1]], only_mean.values[alike.generations[-1]]
    assert np.all(last.min(axis=0) < others.min(axis=0))  # a minimum of a single test attracts those who see it


@pytest.mark.parametrize(("joint", "mean", "single"), [(1 / 3, 22, 21), (1.0, 64, 0), (0.0, 0, 32)])
def test_shares_of_directions(joint, mean, single):
    _, swarm = flown(SwarmSettings(joint=joint, moves=0))
    assert np.sum(np.all(swarm.directions == 1 / 3, axis=1)) == pytest.approx(mean, abs=1)
    assert np.sum(swarm.directions.max(axis=1) == 1) == pytest.approx(single, abs=1)
    assert swarm.directions.sum(axis=1) == pytest.approx(np.ones(64))


def test_a_generation_that_the_budget_does_not_allow_is_left_out():
    log, swarm = flown(SwarmSettings(moves=3, candidates=2), budget=64 * 4 - 1)
    assert len(swarm.generations) == 2
    assert log.used == 64 * 3


def test_failures_attract_nobody():
    def half_failing(u):
        return np.where(u[:, :1] < 0.5, np.nan, u[:, :1])

    log, swarm = flown(SwarmSettings(moves=1, alpha=0.0), objectives=half_failing)
    before, after = log.points[swarm.generations]
    toward = np.linalg.norm(after - before, axis=1) > 0
    assert np.all(after[toward & (before[:, 0] >= 0.5), 0] >= 0.5)


@given(st.integers(2, 60), st.integers(1, 4), st.integers(0, 1000))
def test_every_point_belongs_to_a_centre_at_least_as_bright(count, dimension, seed):
    rng = np.random.default_rng(seed)
    points, cost = rng.random((count, dimension)), rng.random(count)
    centres, labels = cluster_centres(points, cost, SwarmSettings())
    assert np.all(np.diff(cost[centres]) >= 0)
    assert centres[0] == np.argmin(cost)
    assert np.all(cost[centres[labels]] <= cost)
    assert list(labels[centres]) == list(range(len(centres)))


def test_clusters_are_the_basins_of_a_fine_grid():
    u = np.stack(np.meshgrid(*[np.linspace(0, 1, 21)] * 2), axis=-1).reshape(-1, 2)
    cost = three_tests(u).min(axis=1)
    centres, labels = cluster_centres(u, cost, SwarmSettings())
    assert sorted(map(tuple, u[centres].round(6))) == sorted(map(tuple, CENTRES))
    nearest = np.argmin(three_tests(u), axis=1)
    same = nearest[centres][labels] == nearest
    assert same.mean() > 0.95


def test_a_point_that_failed_is_in_no_cluster():
    cost = np.array([0.0, np.inf, 1.0])
    centres, labels = cluster_centres(np.array([[0.0], [0.5], [0.1]]), cost, SwarmSettings())
    assert list(centres) == [0]
    assert labels[0] == labels[2] == 0


def test_settings_are_checked():
    with pytest.raises(InputError, match="alpha"):
        SwarmSettings(alpha=-1.0)
    assert SwarmSettings(share=0.5, moves=3, candidates=2).fireflies(700) == 64
    assert SwarmSettings(most=128).fireflies(10**6) == 128
