"""Criteria, and the search for the best tests, on designs whose best is known."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.errors import InputError
from mofit.experimental_design.criteria import box_precision, parameter_criterion, scales
from mofit.experimental_design.exchange import CandidatePool, best_selection
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
        assert parameter_criterion(criterion, NAMES, chosen)(information) == pytest.approx(value)
    ratio = parameter_criterion("c", NAMES, (), {"a": 1.0, "c": -1.0})(information)
    assert ratio == pytest.approx(np.log(covariance[0, 0] + covariance[2, 2] - 2 * covariance[0, 2]))


def test_samples_are_averaged_or_the_worst_is_taken():
    information = np.stack([np.eye(3), 4 * np.eye(3)])
    assert parameter_criterion("c", NAMES, ("a",))(information) == pytest.approx(-np.log(2))
    assert parameter_criterion("c", NAMES, ("a",), aggregate="worst")(information) == pytest.approx(0.0)


def test_a_failed_sample_makes_a_design_useless_not_the_search():
    information = np.stack([np.eye(3), np.full((3, 3), np.nan)])
    assert parameter_criterion("D", NAMES, NAMES)(information) == np.inf


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("X", NAMES, ("a",)), "criterion"),
        (("D", NAMES, ("z",)), "no such parameter"),
        (("c", NAMES, ("a", "b")), "--combination"),
        (("D", NAMES, ()), "no parameter"),
        (("D", NAMES, ("a",), {"a": 1.0}), "criterion c"),
        (("D", NAMES, ("a",), None, "median"), "--robust"),
    ],
)
def test_criteria_that_make_no_sense_are_errors(arguments, message):
    with pytest.raises(InputError, match=message):
        parameter_criterion(*arguments)


def test_scales_are_values_but_not_nothing_and_the_box_is_uniform():
    space = ParameterSpace((Parameter("a", "1", -1.0, 1.0, 0.0), Parameter("b", "1", 1.0, np.e, 2.0, "log")))
    values = np.array([[0.0, 2.0]])
    np.testing.assert_allclose(scales(space, values), [[0.02, 2.0]])
    # relative to the scales: uniform over 2 / 0.02, and over 1 in the logarithm
    np.testing.assert_allclose(1 / np.diag(box_precision(space, values)[0]), [100**2 / 12, 1 / 12])


def regression(x):
    """Information of one observation of a + b x at each x, one parameter sample, almost nothing known before."""
    rows = np.stack([np.ones_like(x), x], axis=1)
    return CandidatePool(
        (rows[:, :, None] * rows[:, None, :])[:, None],
        1e-6 * np.eye(2)[None],
        np.ones(len(x)),
        parameter_criterion("D", ("a", "b"), ("a", "b")),
    )


def test_a_line_is_measured_at_its_ends():
    """Textbook: the D-optimal design of a straight line takes half of the observations at each end."""
    x = np.linspace(-1, 1, 101)
    found = best_selection(regression(x), 10.0)
    assert found.members == (0,) * 5 + (100,) * 5
    assert found.seconds == 10.0


def test_the_slope_alone_is_also_measured_at_the_ends_and_the_level_anywhere():
    x = np.linspace(-1, 1, 41)
    pool = regression(x)
    slope = CandidatePool(pool.information, pool.start, pool.seconds, parameter_criterion("c", ("a", "b"), ("b",)))
    assert set(best_selection(slope, 4.0).members) == {0, 40}
    level = CandidatePool(pool.information, pool.start, pool.seconds, parameter_criterion("c", ("a", "b"), ("a",)))
    assert np.mean(x[list(best_selection(level, 4.0).members)]) == pytest.approx(0.0, abs=1e-9)


def random_pool(seed, candidates, points=2):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(candidates, points, 2, 3)) * rng.lognormal(size=(candidates, 1, 1, 1))
    return CandidatePool(
        np.swapaxes(rows, -1, -2) @ rows,
        np.broadcast_to(0.01 * np.eye(3), (points, 3, 3)),
        rng.choice([1.0, 2.0, 3.0], size=candidates),
        parameter_criterion("A", NAMES, NAMES),
    )


@given(st.integers(0, 10**6))
def test_few_selections_are_all_evaluated(seed):
    pool, budget = random_pool(seed, 5), 5.0
    found = best_selection(pool, budget)
    every = [m for k in range(1, 6) for m in combinations_with_replacement(range(5), k) if pool.cost(m) <= budget]
    assert found.exhaustive
    assert found.value == pytest.approx(min(pool.value(m) for m in every))


def test_exchanges_end_close_to_the_best_of_all():
    """Where not all selections are evaluated, the one found is the best or almost so."""
    worse = []
    for seed in range(20):
        pool = random_pool(seed, 8)
        best = best_selection(pool, 7.0)
        assert best.exhaustive
        found = best_selection(pool, 7.0, exhaustive=0)
        assert not found.exhaustive
        assert found.seconds <= 7.0
        assert found.value == pytest.approx(pool.value(found.members))
        worse.append(found.value - best.value)
    assert np.mean(np.array(worse) < 1e-6) >= 0.8
    assert max(worse) < 0.1


@given(st.integers(0, 10**6), st.floats(1.0, 15.0))
@settings(max_examples=20, deadline=None)
def test_selections_fit_and_are_no_worse_than_any_single_test(seed, budget):
    pool = random_pool(seed, 20)
    found = best_selection(pool, budget)
    assert found.seconds <= budget + 1e-9
    singles = [pool.value((k,)) for k in range(20) if pool.seconds[k] <= budget]
    assert found.value <= min(singles) + 1e-9
    assert found == best_selection(pool, budget)


def test_no_time_for_any_test_is_an_error():
    with pytest.raises(ValueError, match="budget"):
        best_selection(random_pool(0, 4), 0.5)
