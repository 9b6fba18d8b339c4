"""Refinement on one table of problems with known minima."""

from dataclasses import dataclass

import numpy as np
import pytest

from mofit.errors import InputError
from mofit.optimize import RefineSettings, merge, refine


@dataclass(frozen=True)
class Problem:
    """Residuals in box coordinates x = low + u (high - low); the value is half their sum of squares."""

    name: str
    residuals: object
    low: np.ndarray
    high: np.ndarray
    minimum: np.ndarray | None  # in x; None if only the value is unique
    value: float
    at_bound: tuple[int, ...]

    def evaluate(self, u):
        width = self.high - self.low
        x = self.low + u * width
        r = np.stack([self.residuals(row) for row in x])
        jac = np.empty((*r.shape, x.shape[1]))
        for k in range(x.shape[1]):  # complex step: exact derivatives
            z = x.astype(complex)
            z[:, k] += 1e-30j
            jac[:, :, k] = np.stack([self.residuals(row) for row in z]).imag / 1e-30 * width[k]
        return 0.5 * (r**2).sum(1), np.einsum("nri,nr->ni", jac, r), np.einsum("nri,nrj->nij", jac, jac)


def box(low, high, d):
    return np.full(d, float(low)), np.full(d, float(high))


TRIANGLE = np.array([[2.0, 1.0], [0.0, 3.0]])
PROBLEMS = [
    Problem("quadratic", lambda x: TRIANGLE @ (x - [0.3, -0.2]), *box(-1, 1, 2), np.array([0.3, -0.2]), 0.0, (0, 0)),
    Problem(
        "rosenbrock", lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), *box(-2, 2, 2), np.ones(2), 0.0, (0, 0)
    ),
    Problem(
        "beale",
        lambda x: np.array([y - x[0] * (1 - x[1] ** k) for y, k in ((1.5, 1), (2.25, 2), (2.625, 3))]),
        np.array([1.0, -0.5]),
        np.array([4.0, 0.95]),  # past x1 = 1 the function has other, flat minima
        np.array([3.0, 0.5]),
        0.0,
        (0, 0),
    ),
    Problem(  # singular at its minimum: convergence is slow, the value decides
        "powell singular",
        lambda x: np.array(
            [
                x[0] + 10 * x[1],
                np.sqrt(5) * (x[2] - x[3]),
                (x[1] - 2 * x[2]) ** 2,
                np.sqrt(10) * (x[0] - x[3]) ** 2,
            ]
        ),
        *box(-2, 3, 4),
        None,
        0.0,
        (0, 0, 0, 0),
    ),
    Problem(  # the unconstrained minimum (2, 0) lies outside: minimise along the face x0 = 1
        "quadratic at a face",
        lambda x: TRIANGLE @ (x - [2.0, 0.0]),
        *box(-1, 1, 2),
        np.array([1.0, 0.2]),
        1.8,
        (1, 0),
    ),
    Problem(
        "quadratic in a corner", lambda x: 3 * (x - [-2.0, 4.0]), *box(-1, 1, 2), np.array([-1.0, 1.0]), 45.0, (-1, 1)
    ),
    Problem("flat direction", lambda x: np.array([x[0] - 0.5, 2 * x[0] - 1.0]), *box(0, 1, 2), None, 0.0, (0, 0)),
    Problem("ridge", lambda x: np.array([100 * (x[0] + x[1] - 1.0)]), *box(0, 1, 2), None, 0.0, (0, 0)),
    Problem(  # a minimum with a large residual: the Gauss-Newton Hessian is not the true one
        "large residual",
        lambda x: np.array([x[0] ** 2 + x[1] - 11, x[0] + x[1] ** 2 - 7, 5.0 + 0 * x[0]]),
        *box(0, 5, 2),
        np.array([3.0, 2.0]),
        12.5,
        (0, 0),
    ),
]


@pytest.mark.parametrize(
    "settings",
    [RefineSettings(), RefineSettings(merge=None), RefineSettings(merge=None, lanes=64)],
    ids=["merging", "alone", "several at once"],
)
@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda p: p.name)
def test_every_start_of_the_table_ends_in_the_known_minimum(problem, settings):
    d = len(problem.low)
    starts = np.random.default_rng(3).random((8, d))
    refined = refine(problem.evaluate, starts, settings)
    assert refined.converged.all(), refined.status
    assert np.all((refined.points >= 0) & (refined.points <= 1))
    np.testing.assert_allclose(refined.values, problem.value, atol=1e-6, rtol=1e-9)
    if problem.minimum is not None:
        x = problem.low + refined.points * (problem.high - problem.low)
        np.testing.assert_allclose(x, np.broadcast_to(problem.minimum, x.shape), atol=1e-3)
    np.testing.assert_array_equal(refined.at_bound, np.broadcast_to(problem.at_bound, (8, d)))


def test_the_value_at_the_face_is_the_constrained_minimum():
    # along x0 = 1: r = (-2 + x1, 3 x1), so x1 = 0.2 and the value is (1.8**2 + 0.6**2) / 2
    assert PROBLEMS[4].value == pytest.approx(0.5 * (1.8**2 + 0.6**2))


def test_log_of_a_sum_of_squares_converges_like_a_likelihood():
    t = np.linspace(0, 3, 60)
    noise = np.random.default_rng(0).normal(0, 0.02, t.size)
    y = 0.7 * np.exp(-1.3 * t) + noise

    def evaluate(u):
        a, k = 2 * u[:, :1], 4 * u[:, 1:]
        e = np.exp(-k * t)
        r = a * e - y
        jac = np.stack([2 * e, -4 * t * a * e], axis=2)
        ssr = (r**2).sum(1)
        gradient = np.einsum("nti,nt->ni", jac, r) * (t.size / ssr)[:, None]
        return t.size / 2 * np.log(ssr), gradient, np.einsum("nti,ntj->nij", jac, jac) * (t.size / ssr)[:, None, None]

    refined = refine(evaluate, np.random.default_rng(1).random((16, 2)))
    minima = merge(refined)
    assert len(minima) == 1
    assert minima[0].converged
    assert len(minima[0].members) == 16
    sd = np.sqrt(np.diag(np.linalg.inv(minima[0].hessian)))
    assert np.all(np.abs(minima[0].point - [0.35, 0.325]) < 4 * sd)


def test_failed_regions_are_stepped_around_and_failed_starts_reported():
    problem = PROBLEMS[0]

    def evaluate(u):
        value, gradient, hessian = problem.evaluate(u)
        bad = u[:, 0] > 0.7
        value[bad] = np.nan
        return value, gradient, hessian

    refined = refine(evaluate, np.array([[0.1, 0.9], [0.69, 0.1], [0.9, 0.5]]))
    assert refined.status == ("converged", "converged", "failed")
    assert np.isnan(refined.values[2])
    assert not refined.converged[2]
    np.testing.assert_allclose(refined.points[:2], [[0.65, 0.4]] * 2, atol=1e-5)
    assert len(merge(refined)) == 1
    with pytest.raises(InputError, match="none of the 1 start"):
        refine(evaluate, [[0.9, 0.5]])


def test_a_limit_of_iterations_is_not_called_converged():
    refined = refine(PROBLEMS[1].evaluate, [[0.2, 0.9]], RefineSettings(max_iterations=2))
    assert refined.status == ("limit",)
    assert not refined.converged[0]
    assert refined.evaluations == 3


def test_rounding_noise_stalls_close_to_the_minimum_and_counts_as_converged():
    problem = PROBLEMS[0]

    def evaluate(u):
        value, gradient, hessian = problem.evaluate(u)
        return np.round(value, 5), gradient + 3e-3 * np.sin(1e6 * u), hessian

    refined = refine(evaluate, np.random.default_rng(5).random((6, 2)))
    assert refined.converged.all()
    np.testing.assert_allclose(refined.points, np.broadcast_to([0.65, 0.4], (6, 2)), atol=3e-2)


def test_a_batch_gives_what_each_start_gives_alone():
    problem, alone = PROBLEMS[2], RefineSettings(merge=None)
    starts = np.random.default_rng(8).random((5, 2))
    together = refine(problem.evaluate, starts, alone)
    for row, start in enumerate(starts):
        np.testing.assert_allclose(refine(problem.evaluate, start, alone).points[0], together.points[row], atol=1e-12)


def test_merging_saves_evaluations_and_shares_the_end():
    problem = PROBLEMS[1]
    starts = np.random.default_rng(8).random((40, 2))
    followed, merged = (refine(problem.evaluate, starts, s) for s in (RefineSettings(merge=None), RefineSettings()))
    assert merged.evaluations < 0.8 * followed.evaluations
    assert merged.status.count("merged") > 20
    assert merged.status.count("converged") >= 1
    np.testing.assert_allclose(merged.points, followed.points, atol=1e-3)
    assert len(np.unique(merged.points, axis=0)) == merged.status.count("converged")


def test_with_values_derivatives_are_taken_where_a_step_is_accepted_alone():
    problem, derived = PROBLEMS[1], []

    def evaluate(u):
        derived.extend(map(tuple, u))
        return problem.evaluate(u)

    whole = refine(evaluate, [[0.2, 0.9]])
    assert len(derived) == whole.evaluations
    derived.clear()
    judged = refine(evaluate, [[0.2, 0.9]], values=lambda u: problem.evaluate(u)[0])
    np.testing.assert_array_equal(judged.points, whole.points)
    assert judged.evaluations == whole.evaluations > len(derived)
    assert np.all(np.diff(problem.evaluate(np.array(derived))[0]) < 0)


def test_a_start_that_is_given_up_ends_where_it_is_and_the_others_go_on():
    """Of two starts the one at the larger value is given up at once."""
    rosenbrock = next(one for one in PROBLEMS if one.name == "rosenbrock")
    starts, asked = np.array([[0.1, 0.9], [0.6, 0.6]]), []

    def go_on(values, promised):
        asked.append(values)
        assert np.all(promised[np.isfinite(values)] >= 0)
        return values < np.max(asked[0])

    found = refine(rosenbrock.evaluate, starts, go_on=go_on)
    worse = int(np.argmax(asked[0]))
    assert found.status[worse] == "limit"
    assert found.status[1 - worse] == "converged"
    np.testing.assert_array_equal(found.points[worse], starts[worse])
    assert found.values[1 - worse] == pytest.approx(0.0, abs=1e-6)
