"""CMA-ES from many starts, and the search of rough landscapes that uses it."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.optimize.cma import adapt
from mofit.optimize.searches.effa import EffaSettings, search

STARTS = np.array([[0.2, 0.9, 0.4, 0.6, 0.1], [0.8, 0.2, 0.5, 0.3, 0.7], [0.5, 0.5, 0.9, 0.9, 0.5]])
CENTRE = np.array([0.3, 0.4, 0.5, 0.6, 0.7])


def stiff(u):
    """A quadratic of condition 1e6."""
    return ((u - CENTRE) ** 2) @ 10.0 ** np.linspace(0, 6, 5)


def rosenbrock(u):
    x = 4 * u - 2
    return np.sum(100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2, axis=1)


def kinked(u):
    return np.abs(u - CENTRE).sum(axis=1)


@pytest.mark.parametrize(("function", "minimum"), [(stiff, CENTRE), (rosenbrock, np.full(5, 0.75)), (kinked, CENTRE)])
def test_every_start_reaches_the_minimum(function, minimum, rng):
    starts = STARTS if function is not rosenbrock else minimum + 0.2 * (STARTS - 0.5)  # it has another, local minimum
    runs = adapt(function, starts, np.full(3, 0.1), rng)
    assert runs.converged.all()
    assert runs.points == pytest.approx(np.tile(minimum, (3, 1)), abs=1e-6)
    assert runs.cost == pytest.approx(function(runs.points), rel=1e-12)


def test_a_minimum_on_the_bound(rng):
    runs = adapt(lambda u: u.sum(axis=1), STARTS, np.full(3, 0.1), rng)
    assert runs.points == pytest.approx(np.zeros((3, 5)), abs=1e-6)


def test_all_runs_end_where_the_budget_does(rng):
    spent = []

    def limited(u):
        u = u[: 1000 - sum(spent)]
        spent.append(len(u))
        return stiff(u)

    runs = adapt(limited, STARTS, np.full(3, 0.1), rng)
    assert sum(spent) == 1000
    assert not runs.converged.any()
    assert runs.cost == pytest.approx(stiff(runs.points))


def test_same_seed_same_runs():
    first, again, other = (
        adapt(kinked, STARTS, np.full(3, 0.1), np.random.default_rng(seed)).points for seed in (3, 3, 4)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_failed_evaluations_are_the_worst(rng):
    runs = adapt(lambda u: np.where(u[:, 0] < 0.25, np.nan, stiff(u)), STARTS, np.full(3, 0.1), rng)
    assert runs.points == pytest.approx(np.tile(CENTRE, (3, 1)), abs=1e-6)


def test_a_stop_rule_ends_runs(rng):
    runs = adapt(stiff, STARTS, np.full(3, 0.1), rng, stop=lambda runs: runs.cost < 1.0)
    assert not runs.converged.any()
    assert np.all(runs.cost < 1.0)
    assert np.all(runs.cost > 1e-12)


VALLEYS = np.array([[0.2, 0.3], [0.7, 0.8], [0.8, 0.2]])


def weierstrass(u):
    """Three equal minima in fractal valleys, shape (N, 1): the gradient says nothing about where they are."""
    gap = u[:, None] - VALLEYS
    waves = sum(0.5**k * (1 - np.cos(2 * np.pi * 3**k * 2 * gap)) for k in range(12))
    return np.sum(gap**2 + 0.05 * waves, axis=2).min(axis=1)[:, None]


def steep(u):
    """With a gradient by small differences."""
    moves = 1e-9 * np.eye(2)
    slopes = [(weierstrass(u + move) - weierstrass(u - move)) / 2e-9 for move in moves]
    return weierstrass(u), np.stack(slopes, axis=2)


def with_budget(evaluations):
    settings = EffaSettings()
    return replace(settings, completion=replace(settings.completion, evaluations=evaluations))


def test_the_default_search_adapts_where_gradients_lead_nowhere(rng):
    result = search(weierstrass, steep, 2, rng, with_budget(20_000))
    assert set(result.found_by) == {"adaptation"}
    assert result.evaluations == 20_000
    assert not result.complete
    found = result.archived_points[np.lexsort(result.archived_points.T[::-1])]
    assert found == pytest.approx(VALLEYS, abs=1e-4)


@pytest.mark.parametrize("evaluations", [1200, 20_000])
def test_it_descends_where_they_do_or_the_budget_is_small(evaluations, rng):
    smooth = (
        (lambda u: ((u - 0.4) ** 2).sum(axis=1)[:, None]),
        (lambda u: (((u - 0.4) ** 2).sum(axis=1)[:, None], 2 * (u - 0.4)[:, None])),
    )
    for value, gradient in (smooth, *([(weierstrass, steep)] if evaluations < 4000 else [])):
        result = search(value, gradient, 2, rng, with_budget(evaluations))
        assert set(result.found_by) <= {"swarm", "completion"}


def test_equal_seeds_find_the_same_in_rough_landscapes():
    first, again = (search(weierstrass, steep, 2, np.random.default_rng(5), with_budget(8_000)) for _ in range(2))
    assert np.array_equal(first.points, again.points)
    assert np.array_equal(first.archived, again.archived)
