"""Criteria and programmes on designs whose best is known."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.errors import InputError
from mofit.identifiability.criteria import box_precision, goal, scales
from mofit.identifiability.programme import Pool, best_programme
from mofit.parameters import Parameter, ParameterSpace

NAMES = ("a", "b", "c")


def random_information(seed, *shape, d=3):
    root = np.random.default_rng(seed).normal(size=(*shape, d, d))
    return root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(d)


@given(st.integers(0, 10**6))
def test_criteria_are_those_of_the_covariance(seed):
    information = random_information(seed, 1)
    covariance = np.linalg.inv(information[0])
    both = covariance[:2, :2]
    expected = {
        ("c", ("b",)): np.log(covariance[1, 1]),
        ("D", ("a", "b")): 0.5 * np.log(np.linalg.det(both)),
        ("A", ("a", "b")): np.log(np.trace(both) / 2),
        ("E", ("a", "b")): np.log(np.linalg.eigvalsh(both)[-1]),
    }
    for (criterion, chosen), value in expected.items():
        assert goal(criterion, NAMES, chosen)(information) == pytest.approx(value)
    ratio = goal("c", NAMES, (), {"a": 1.0, "c": -1.0})(information)
    assert ratio == pytest.approx(np.log(covariance[0, 0] + covariance[2, 2] - 2 * covariance[0, 2]))


def test_points_are_averaged_or_the_worst_is_taken():
    information = np.stack([np.eye(3), 4 * np.eye(3)])
    assert goal("c", NAMES, ("a",))(information) == pytest.approx(-np.log(2))
    assert goal("c", NAMES, ("a",), aggregate="worst")(information) == pytest.approx(0.0)


def test_a_failed_point_makes_a_design_useless_not_the_search():
    information = np.stack([np.eye(3), np.full((3, 3), np.nan)])
    assert goal("D", NAMES, NAMES)(information) == np.inf


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("X", NAMES, ("a",)), "criterion"),
        (("D", NAMES, ("z",)), "no such parameter"),
        (("c", NAMES, ("a", "b")), "--combination"),
        (("D", NAMES, ()), "no parameter"),
        (("D", NAMES, ("a",), {"a": 1.0}), "criterion c"),
        (("D", NAMES, ("a",), None, "median"), "--robust"),
    ],
)
def test_goals_that_make_no_sense_are_refused(arguments, told):
    with pytest.raises(InputError, match=told):
        goal(*arguments)


def test_scales_are_values_but_not_nothing_and_the_box_is_uniform():
    space = ParameterSpace((Parameter("a", "1", -1.0, 1.0, 0.0), Parameter("b", "1", 1.0, np.e, 2.0, "log")))
    values = np.array([[0.0, 2.0]])
    np.testing.assert_allclose(scales(space, values), [[0.02, 2.0]])
    # uniform over 2, and over 1 in the logarithm, which is 2 in natural units at 2
    np.testing.assert_allclose(1 / np.diag(box_precision(space, values)[0]), [4 / 12, 4 / 12])


def regression(x):
    """Information of one observation of a + b x at each x, one parameter point, almost nothing known before."""
    rows = np.stack([np.ones_like(x), x], axis=1)
    return Pool(
        (rows[:, :, None] * rows[:, None, :])[:, None],
        1e-6 * np.eye(2)[None],
        np.ones(len(x)),
        goal("D", ("a", "b"), ("a", "b")),
    )


def test_a_line_is_measured_at_its_ends():
    """Textbook: the D-optimal design of a straight line takes half of the observations at each end."""
    x = np.linspace(-1, 1, 101)
    found = best_programme(regression(x), 10.0)
    assert found.members == (0,) * 5 + (100,) * 5
    assert found.seconds == 10.0


def test_the_slope_alone_is_also_measured_at_the_ends_and_the_level_anywhere():
    x = np.linspace(-1, 1, 41)
    pool = regression(x)
    slope = Pool(pool.information, pool.start, pool.seconds, goal("c", ("a", "b"), ("b",)))
    assert set(best_programme(slope, 4.0).members) == {0, 40}
    level = Pool(pool.information, pool.start, pool.seconds, goal("c", ("a", "b"), ("a",)))
    assert np.mean(x[list(best_programme(level, 4.0).members)]) == pytest.approx(0.0, abs=1e-9)


def random_pool(seed, candidates, points=2):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(candidates, points, 2, 3)) * rng.lognormal(size=(candidates, 1, 1, 1))
    return Pool(
        np.swapaxes(rows, -1, -2) @ rows,
        np.broadcast_to(0.01 * np.eye(3), (points, 3, 3)),
        rng.choice([1.0, 2.0, 3.0], size=candidates),
        goal("A", NAMES, NAMES),
    )


@given(st.integers(0, 10**6))
def test_few_programmes_are_all_looked_at(seed):
    pool, budget = random_pool(seed, 5), 5.0
    found = best_programme(pool, budget)
    every = [m for k in range(1, 6) for m in combinations_with_replacement(range(5), k) if pool.cost(m) <= budget]
    assert found.exhaustive
    assert found.value == pytest.approx(min(pool.value(m) for m in every))


def test_exchanges_end_close_to_the_best_of_all(monkeypatch):
    """Where not all programmes are looked at, the one found is the best or almost so."""
    import mofit.identifiability.programme as programme

    lost = []
    for seed in range(20):
        pool = random_pool(seed, 8)
        best = best_programme(pool, 7.0)
        assert best.exhaustive
        with monkeypatch.context() as patch:
            patch.setattr(programme, "FEW", 0)
            found = best_programme(pool, 7.0)
        assert not found.exhaustive
        assert found.seconds <= 7.0
        assert found.value == pytest.approx(pool.value(found.members))
        lost.append(found.value - best.value)
    assert np.mean(np.array(lost) < 1e-6) >= 0.8
    assert max(lost) < 0.1


@given(st.integers(0, 10**6), st.floats(1.0, 30.0))
def test_programmes_fit_and_are_no_worse_than_any_single_test(seed, budget):
    pool = random_pool(seed, 30)
    found = best_programme(pool, budget)
    assert found.seconds <= budget + 1e-9
    singles = [pool.value((k,)) for k in range(30) if pool.seconds[k] <= budget]
    assert found.value <= min(singles) + 1e-9
    assert found == best_programme(pool, budget)


def test_no_time_for_any_test_is_said():
    with pytest.raises(ValueError, match="budget"):
        best_programme(random_pool(0, 4), 0.5)
