"""The default search: a swarm, its clusters, a completion, the front."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rastrigin import Rastrigin, found
from mofit.errors import InputError
from mofit.optimize.evaluation_log import EvaluationLog
from mofit.optimize.minima_archive import Endpoint, MinimaArchive, add_if_new
from mofit.optimize.pareto_front import nondominated
from mofit.optimize.searches.effa import EffaSettings, search

CENTRES = np.array([[0.3, 0.3, 0.3], [0.6, 0.4, 0.3], [0.4, 0.7, 0.5], [0.5, 0.5, 0.7]])


def bowls(u):
    """One quadratic objective per centre; the mean's minimum is the mean of the centres."""
    return np.sum((u[:, None] - CENTRES) ** 2, axis=-1)


def slopes(u):
    return bowls(u), 2 * (u[:, None] - CENTRES)


def with_budget(evaluations, **more):
    settings = EffaSettings()
    return replace(settings, completion=replace(settings.completion, evaluations=evaluations, **more))


@pytest.mark.parametrize("turned", [False, True])
def test_all_minima_of_rastrigin_most_of_them_from_the_swarm(turned):
    shares = []
    for seed in range(5):
        rng = np.random.default_rng([7, seed])
        function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
        result = search(function.value, function.gradient, 2, rng, with_budget(700))
        answers, by = function.scaled(result.archived_points), np.array(result.found_by)
        assert found(answers, function.minima, 0.05) == len(function.minima)
        assert result.evaluations == 700
        shares.append(found(answers[by == "swarm"], function.minima, 0.05) / len(function.minima))
        assert set(by) <= {"swarm", "completion"}
    assert np.mean(shares) > 22 / 25


def test_one_minimum_is_complete_before_the_budget_is_spent():
    result = search(
        lambda u: bowls(u)[:, :1], lambda u: tuple(x[:, :1] for x in slopes(u)), 3, np.random.default_rng(0)
    )
    assert result.complete
    assert result.expected_undiscovered < 0.01
    assert result.evaluations < 700
    assert result.found_by == ("swarm",)
    assert result.archived_points == pytest.approx(CENTRES[:1], abs=2e-3)


def test_a_spent_budget_is_said():
    function = Rastrigin.plain()
    result = search(function.value, function.gradient, 2, np.random.default_rng(0), with_budget(300))
    assert not result.complete
    assert result.evaluations == 300
    assert result.expected_undiscovered > 0.01


def test_several_objectives():
    result = search(bowls, slopes, 3, np.random.default_rng(0))
    assert result.evaluations < 1500  # the front takes no more than its share
    assert result.archived_points[0] == pytest.approx(CENTRES.mean(axis=0), abs=2e-3)
    gaps = np.linalg.norm(result.archived_points[:, None] - CENTRES, axis=2)
    assert np.all(gaps.min(axis=0) < 5e-3)  # the minima of single objectives
    assert np.array_equal(result.front, nondominated(result.objectives))
    assert len(result.front) > 300
    assert result.complete


def test_the_fireflies_are_kept_with_their_clusters():
    result = search(bowls, slopes, 3, np.random.default_rng(0))
    assert result.generations.shape == result.generation_labels.shape == (3, 64)
    assert np.array_equal(result.population, result.generations[-1])
    assert np.array_equal(result.labels, result.generation_labels[-1])
    assert len(np.unique(result.generations)) == 192
    assert result.generation_labels.min() == 0


def test_same_seed_same_search():
    first, again, other = (search(bowls, slopes, 3, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert np.array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)


def test_if_every_firefly_fails_it_is_said():
    with pytest.raises(InputError, match="all 32 start points failed"):
        search(lambda u: np.full((len(u), 2), np.nan), slopes, 3, np.random.default_rng(0))


def test_weights_decide_what_the_mean_is():
    result = search(bowls, slopes, 3, np.random.default_rng(0), weights=[1, 0, 0, 1])
    assert result.archived_points[0] == pytest.approx((CENTRES[0] + CENTRES[3]) / 2, abs=2e-3)


@pytest.mark.parametrize(("finished", "minima"), [(True, 2), (False, 1)])
def test_an_unfinished_descent_is_no_minimum_beside_another(finished, minima):
    function = Rastrigin.plain()
    log = EvaluationLog(function.value, function.gradient, 2, 100)
    archive = MinimaArchive(np.ones(1))
    for point, done in ((0.5, True), (0.25, finished)):
        rows, values = log.evaluate(np.full((1, 2), point))
        end = Endpoint(int(rows[0]), np.full(2, point), float(values[0, 0]), np.eye(2), done)
        add_if_new(log, archive, end, 1.0, 5e-3, "swarm")
    assert len(archive.ends) == minima
    assert archive.ends[0].found_by == "swarm"
