"""What a fit has computed is not computed again."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Linear
from mofit.diagnosis.remembered import Remembered
from mofit.runtime.parallel import may_fork
from mofit.runtime.team import team


@dataclass
class _Bowl:
    """Residuals u - c of points in the plane, one at a time; counts what it is asked for."""

    asked: list[FloatArray] = field(default_factory=list)

    def linear(self, u: FloatArray) -> Linear:
        self.asked += list(u)
        residual = u - np.array([0.3, 0.6])
        residual[np.any(u > 1, axis=1)] = np.nan
        return Linear(residual, np.broadcast_to(np.eye(2), (len(u), 2, 2)))

    def linear_parts(self, u: FloatArray) -> Iterator[Linear]:
        return (self.linear(point[None]) for point in u)


def test_no_point_is_computed_twice() -> None:
    bowl = _Bowl()
    remembered = Remembered(bowl)  # type: ignore[arg-type]
    first, second, lowest = np.array([[0.1, 0.2], [0.9, 0.9], [0.3, 0.5]])
    remembered.evaluate(np.stack([first, second]))
    value, gradient, hessian = remembered.evaluate(np.stack([second, lowest, first]))
    expected = np.stack([second, lowest, first]) - [0.3, 0.6]
    np.testing.assert_allclose(value, 0.5 * np.sum(expected**2, axis=1))
    np.testing.assert_allclose(gradient, expected)
    np.testing.assert_allclose(hessian, np.broadcast_to(np.eye(2), (3, 2, 2)))
    assert len(bowl.asked) == 3
    residual, jacobian = remembered.linear(lowest)
    np.testing.assert_allclose(residual, lowest - [0.3, 0.6])
    np.testing.assert_allclose(jacobian, np.eye(2))
    assert len(bowl.asked) == 3  # the lowest is there in full
    np.testing.assert_allclose(remembered.linear(first)[0], first - [0.3, 0.6])


def test_a_point_that_fails_is_never_the_lowest() -> None:
    remembered = Remembered(_Bowl())  # type: ignore[arg-type]
    good, failed = np.array([0.2, 0.2]), np.array([2.0, 0.2])
    value, *_ = remembered.evaluate(np.stack([failed, good]))
    assert np.isnan(value[0])
    np.testing.assert_allclose(remembered.linear(good)[0], good - [0.3, 0.6])


@pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")
def test_a_team_shares_the_points_of_a_fit() -> None:
    class Wide(_Bowl):
        observed = SimpleNamespace(measured=np.empty(20_000), processes=2)

        def linear(self, u: FloatArray) -> Linear:
            time.sleep(0.3)  # meanwhile the other one takes its part
            return super().linear(u)

    points = np.random.default_rng(0).random((5, 2))
    alone, bowl = Remembered(_Bowl()), Wide()  # type: ignore[arg-type]
    remembered = Remembered(bowl)  # type: ignore[arg-type]
    with team(2):
        found, asked = remembered.evaluate(points), len(bowl.asked)
        again = remembered.evaluate(points[::-1])
        rows = [remembered.linear(point) for point in points]
    for new, backwards, old in zip(found, again, alone.evaluate(points), strict=True):
        np.testing.assert_array_equal(new, old)
        np.testing.assert_array_equal(backwards, old[::-1])
    assert asked in (2, 3)
    for (residual, _), point in zip(rows, points, strict=True):
        np.testing.assert_array_equal(residual, point - [0.3, 0.6])
