"""A refinement with a limit: the same minimum where it counts, few evaluations where it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from mofit.diagnosis.limited_refinement import best_minimum
from mofit.errors import InputError
from mofit.optimize import RefineSettings

FLOOR = 5000.0
START = np.array([[0.1, 0.9]])


class Valley:
    """Rosenbrock's valley over the unit square, with a floor; its minimum is at x = y = 3/4."""

    def __init__(self) -> None:
        self.evaluations = 0

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        self.evaluations += len(points)
        x, y = (4 * points - 2).T
        residual = np.stack([100 * (y - x**2), 1 - x], axis=1)
        jacobian = 4 * np.stack([np.stack([-200 * x, 100 + 0 * x], 1), np.stack([-1 + 0 * x, 0 * x], 1)], axis=1)
        gradient = np.einsum("kij,ki->kj", jacobian, residual)
        return FLOOR + 0.5 * np.sum(residual**2, axis=1), gradient, np.einsum("kij,kil->kjl", jacobian, jacobian)


def refined(limit: float) -> tuple[float, np.ndarray, int]:
    valley = Valley()
    found = best_minimum(valley, START, RefineSettings(), limit)
    return found.value, found.point, valley.evaluations


@pytest.mark.parametrize(("limit", "within"), [(np.inf, 1e-6), (FLOOR, 1e-2), (FLOOR + 60, 1e-2)])
def test_what_may_reach_the_limit_is_fitted_to_what_counts_beside_it(limit: float, within: float) -> None:
    value, point, _ = refined(limit)
    assert value == pytest.approx(FLOOR, abs=within)
    # of a curved valley: a hundredth of a nat is a seventh of a standard deviation
    np.testing.assert_allclose(point, 0.75, atol=1e-4 if within < 1e-3 else 0.05)


def test_what_cannot_reach_it_ends_early_and_hardly_above() -> None:
    value, _, evaluations = refined(0.0)
    assert evaluations < refined(np.inf)[2] / 2
    assert FLOOR < value < 1.01 * FLOOR


def test_the_best_of_several_starts_counts() -> None:
    found = best_minimum(Valley(), np.array([[0.1, 0.9], [0.74, 0.74]]), RefineSettings(), FLOOR)
    assert found.value == pytest.approx(FLOOR, abs=1e-6)


class Hills:
    """Two minima on a line: near 0.2, of the floor's value, and near 0.8, far above it."""

    def __init__(self) -> None:
        self.evaluations = 0

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        self.evaluations += len(points)
        x = points[:, 0]
        residual = np.stack([300 * (x - 0.2) * (x - 0.8), 30 * (x - 0.2)], axis=1)
        jacobian = np.stack([600 * x - 300, 30 + 0 * x], axis=1)
        gradient = np.sum(jacobian * residual, axis=1, keepdims=True)
        return FLOOR + 0.5 * np.sum(residual**2, axis=1), gradient, np.sum(jacobian**2, axis=1)[:, None, None]


def test_a_start_that_cannot_catch_up_with_the_best_ends_early() -> None:
    def climbed(*starts: float) -> tuple[float, int]:
        hills = Hills()
        found = best_minimum(hills, np.array(starts)[:, None], RefineSettings(), FLOOR + 1000)
        return found.value, hills.evaluations

    (low, first), (high, second), (value, both) = climbed(0.3), climbed(0.65), climbed(0.3, 0.65)
    assert value == pytest.approx(low) == pytest.approx(FLOOR)
    assert high > FLOOR + 100
    assert both <= first + second / 2


def test_a_start_that_leads_to_what_is_known_ends_early() -> None:
    def evaluations(known: float) -> tuple[float, int]:
        valley = Valley()
        found = best_minimum(valley, np.array([[0.1, 0.9], [0.2, 0.8]]), RefineSettings(), FLOOR + 1000, known=known)
        return found.value, valley.evaluations

    (value, every), (lower, same), (_, few) = (evaluations(known) for known in (np.inf, FLOOR + 10, FLOOR - 10))
    assert value == pytest.approx(FLOOR, abs=1e-2) == lower
    assert same == every
    assert few < every / 2


def test_starts_that_cannot_be_evaluated_are_told() -> None:
    def fails(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        value, gradient, hessian = Valley()(points)
        return np.nan * value, gradient, hessian

    with pytest.raises(InputError):
        best_minimum(fails, START, RefineSettings(), 0.0)


def test_derivatives_of_any_size_are_no_error() -> None:
    """Two parameters that do the same, as steeply as a diverging integration has it."""

    def steep(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        residual = 1e20 * (points.sum(axis=1) - 0.5)
        gradient = 1e20 * residual[:, None] * np.ones(2)
        return FLOOR + 0.5 * residual**2, gradient, np.full((len(points), 2, 2), 1e40)

    found = best_minimum(steep, START, RefineSettings(max_iterations=9), FLOOR)
    assert np.isfinite(found.value)


class Disagreeing(Valley):
    """Values that fall by a hundred-thousandth of what the derivatives promise: no point passes for a minimum."""

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        value, gradient, hessian = super().__call__(points)
        return FLOOR + 1e-5 * (value - FLOOR), gradient, hessian


def test_a_start_that_no_longer_gains_anything_ends() -> None:
    def evaluations(limit: float) -> int:
        valley = Disagreeing()
        best_minimum(valley, START, RefineSettings(accept=0.0), limit)
        return valley.evaluations

    assert evaluations(2 * FLOOR) < evaluations(np.inf) / 2


@pytest.mark.parametrize(("share", "ends_at", "within"), [(1e-3, FLOOR + 9, 10), (0.1, FLOOR, 100)])
def test_a_start_that_gains_little_of_what_is_promised_ends(share: float, ends_at: float, within: int) -> None:
    """On a slope that falls by a share of what its derivative says: by a tenth is slow, by a thousandth is wrong."""
    evaluations = 0

    def slope(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nonlocal evaluations
        evaluations += len(points)
        value = FLOOR + 1e4 * share * (1 - points[:, 0])
        return value, np.full((len(points), 1), -1e4), np.full((len(points), 1, 1), 1e6)

    found = best_minimum(slope, [[0.1]], RefineSettings(damping=1e-9), 2 * FLOOR)
    assert found.value == pytest.approx(ends_at, abs=1)
    assert evaluations <= within


def test_beside_a_best_start_that_is_given_up_others_must_promise_to_be_better() -> None:
    def ended(limit: float) -> int:
        evaluations = 0

        def bowl(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            nonlocal evaluations
            evaluations += len(points)
            away = points - 0.5
            # a Newton step promises seven tenths of the way to the minimum
            return FLOOR + 5e3 * away[:, 0] ** 2, 1e4 * away, np.full((len(points), 1, 1), 1e4 / 0.7)

        best_minimum(bowl, [[0.5], [0.9]], RefineSettings(merge=None), limit)
        return evaluations

    assert ended(0.0) < ended(FLOOR + 1)


def test_a_start_alone_is_given_up_at_once() -> None:
    """It is near its minimum: what it promises there is all that can be had."""
    valley = Valley()
    found = best_minimum(valley, [[0.74, 0.74]], RefineSettings(), 0.0)
    assert valley.evaluations == 1
    np.testing.assert_array_equal(found.point, [0.74, 0.74])
