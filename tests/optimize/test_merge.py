"""Same minimum or another one: known landscapes."""

import numpy as np
import pytest

from mofit.optimize import merge, refine


def double_well(u):
    """Minima at u0 = 0.25 (value 0) and near 0.75 (value 3), barrier between; u1 quadratic."""
    x, y = u[:, 0], u[:, 1]
    w = 2000.0
    r = np.stack([(x - 0.25) * (x - 0.75), (y - 0.5) / 4], axis=1)
    jac = np.zeros((len(u), 2, 2))
    jac[:, 0, 0] = 2 * x - 1.0
    jac[:, 1, 1] = 0.25
    value = w * 5 * (r**2).sum(1) + 6 * x**2
    gradient = 10 * w * np.einsum("nri,nr->ni", jac, r)
    gradient[:, 0] += 12 * x
    hessian = 10 * w * np.einsum("nri,nrj->nij", jac, jac)
    hessian[:, 0, 0] += 12
    return value, gradient, hessian


@pytest.mark.parametrize("values", [None, lambda u: double_well(u)[0]], ids=["close only", "hill-valley"])
def test_two_wells_are_two_minima_best_first(values):
    starts = np.array([[0.8, 0.2], [0.2, 0.1], [0.3, 0.9], [0.7, 0.6], [0.2, 0.2]])
    minima = merge(refine(double_well, starts), values=values)
    assert [m.point[0] < 0.5 for m in minima] == [True, False]
    assert [set(m.members) for m in minima] == [{1, 2, 4}, {0, 3}]
    assert minima[0].value < minima[1].value


def flat_valley(u):
    gap = u[:, 0] + u[:, 1] - 1.0
    normal = np.broadcast_to(1e4 * np.ones((2, 2)), (len(u), 2, 2))
    return 5e3 * gap**2, 1e4 * np.repeat(gap[:, None], 2, axis=1), normal


def test_points_along_a_flat_valley_are_one_minimum_only_by_the_hill_valley_test():
    refined = refine(flat_valley, np.random.default_rng(0).random((6, 2)))
    assert len(merge(refined)) > 1
    assert len(merge(refined, values=lambda u: flat_valley(u)[0])) == 1


def test_a_failed_region_between_two_points_separates_them():
    refined = refine(flat_valley, [[0.2, 0.8], [0.8, 0.2]])

    def walled(u):
        return np.where(np.abs(u[:, 0] - 0.5) < 0.2, np.nan, flat_valley(u)[0])

    assert len(merge(refined, values=walled)) == 2
