"""Profiles against the analytic one of a Gaussian, of a banana, and against scipy on a model with gradients."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from mofit.identification.result_tree.modes import profile_group
from mofit.optimize import profile
from mofit.parameters import Parameter, ParameterSpace


class Gaussian:
    """A quadratic form about a centre."""

    def __init__(self, centre, precision):
        self.centre, self.precision = np.asarray(centre, dtype=float), np.asarray(precision, dtype=float)

    def evaluate(self, u):
        pull = (u - self.centre) @ self.precision
        value = 7.0 + 0.5 * np.sum(pull * (u - self.centre), axis=1)
        return value, pull, np.broadcast_to(self.precision, (len(u), *self.precision.shape)).copy()


class Residuals:
    """Half the sum of squares of residuals r(x), with complex-step derivatives."""

    def __init__(self, residuals):
        self.residuals = residuals

    def evaluate(self, u):
        r = np.stack([self.residuals(row) for row in u])
        jac = np.empty((*r.shape, u.shape[1]))
        for k in range(u.shape[1]):
            z = u.astype(complex)
            z[:, k] += 1e-30j
            jac[:, :, k] = np.stack([self.residuals(row) for row in z]).imag / 1e-30
        return 0.5 * (r**2).sum(axis=1), np.einsum("nri,nr->ni", jac, r), np.einsum("nri,nrj->nij", jac, jac)


def covariance(d: int, rng: np.random.Generator) -> np.ndarray:
    root = 0.03 * rng.normal(size=(d, d)) + 0.02 * np.eye(d)
    return root @ root.T


@pytest.mark.parametrize("d", [1, 2, 5])
def test_profile_of_a_gaussian_is_its_marginal(d, rng) -> None:
    spread = covariance(d, rng)
    sd = np.sqrt(np.diag(spread))
    found = profile(Gaussian(np.full(d, 0.5), np.linalg.inv(spread)), np.full(d, 0.5), sd)
    assert found.converged.all()
    np.testing.assert_allclose(found.neg_log_posterior, 0.5 * ((found.grid - 0.5) / sd[:, None]) ** 2, atol=1e-6)
    np.testing.assert_allclose(found.grid[:, [0, 6, -1]], 0.5 + sd[:, None] * [-3.0, 0.0, 3.0], atol=1e-12)
    slope = spread / np.diag(spread)[:, None]  # the others follow the regression line
    np.testing.assert_allclose(
        found.points, 0.5 + (found.grid - 0.5)[:, :, None] * slope[:, None, :], atol=1e-4 * sd.max()
    )


def test_the_grid_ends_at_the_box_and_holds_the_minimum(rng) -> None:
    spread = covariance(3, rng)
    centre = np.array([0.0, 0.5, 0.97])
    sd = np.array([0.2, 0.3, 0.05])
    found = profile(Gaussian(centre, np.linalg.inv(spread)), centre, sd, points=8)
    assert found.grid.shape == (3, 8)
    assert ((found.points >= 0) & (found.points <= 1)).all()
    np.testing.assert_allclose(found.grid[:, [0, -1]], [[0.0, 0.6], [0.0, 1.0], [0.82, 1.0]], atol=1e-12)
    assert all(centre[k] in found.grid[k] for k in range(3))
    assert (np.diff(found.grid, axis=1) > 0).all()


def test_others_stop_at_their_bound() -> None:
    # the ridge u0 + u1 = 1.6 (sd 0.01) leaves the box where u0 < 0.6: from there u1 stays at 1
    problem = Residuals(lambda x: np.array([(x[0] + x[1] - 1.6) / 0.01, (x[0] - 0.8) / 0.5]))
    found = profile(problem, [0.8, 0.8], [0.3, 0.3], points=19)
    c = found.grid[0]
    expected = 0.5 * ((c - 0.8) / 0.5) ** 2 + 0.5 * (np.minimum(c - 0.6, 0.0) / 0.01) ** 2
    assert found.converged.all()
    np.testing.assert_allclose(found.neg_log_posterior[0], expected, atol=1e-3)
    assert np.all(found.points[0, c < 0.59, 1] == 1.0)


def test_profile_of_a_banana() -> None:
    # x1 follows x0 squared: over x0 the profile is that of the first residual alone
    problem = Residuals(lambda x: np.array([(x[0] - 0.5) / 0.1, (x[1] - 0.5 - 4 * (x[0] - 0.5) ** 2) / 0.005]))
    found = profile(problem, [0.5, 0.5], [0.1, 0.06])
    assert found.converged.all()
    c = found.grid[0]
    np.testing.assert_allclose(found.neg_log_posterior[0], 0.5 * ((c - 0.5) / 0.1) ** 2, atol=1e-5)
    np.testing.assert_allclose(found.points[0, :, 1], 0.5 + 4 * (c - 0.5) ** 2, atol=1e-4)


def test_profile_agrees_with_scipy() -> None:
    time = np.linspace(0, 3, 40)
    truth = np.array([0.6, 0.4, 0.5])

    def model(x):
        return (0.5 + x[0]) * np.exp(-(0.2 + 2 * x[1]) * time) + x[2] * np.exp(-3 * x[1] * time)

    data = model(truth) + 0.02 * np.sin(37 * time)
    problem = Residuals(lambda x: (model(x) - data) / 0.02)

    def least(k=None, c=0.0, start=truth):
        def value(y):
            return problem.evaluate((y if k is None else np.insert(y, k, c))[None])[0][0]

        begin = start if k is None else np.delete(start, k)
        ends = minimize(value, begin, method="L-BFGS-B", bounds=[(0, 1)] * len(begin), options={"ftol": 1e-15})
        return minimize(value, ends.x, method="Nelder-Mead", bounds=[(0, 1)] * len(begin),
                        options={"xatol": 1e-10, "fatol": 1e-10, "maxiter": 4000})  # fmt: skip

    best = least()
    hessian = problem.evaluate(best.x[None])[2][0]
    found = profile(problem, best.x, np.sqrt(np.diag(np.linalg.inv(hessian + 12 * np.eye(3)))), points=5)
    assert found.converged.all()
    for k in range(3):
        for p in (0, 1, 4):
            expected = least(k, found.grid[k, p], found.points[k, p]).fun - best.fun
            assert found.neg_log_posterior[k, p] == pytest.approx(expected, abs=2e-4)


def test_points_where_the_model_fails_are_nan() -> None:
    class Half(Gaussian):
        def evaluate(self, u):
            value, gradient, hessian = super().evaluate(u)
            return np.where(u[:, 0] > 0.55, np.nan, value), gradient, hessian

    found = profile(Half([0.5, 0.5], np.eye(2) / 0.05**2), [0.5, 0.5], [0.05, 0.05])
    failed = found.grid[0] > 0.55
    assert failed.any()
    assert np.isnan(found.neg_log_posterior[0, failed]).all()
    assert not found.converged[0, failed].any()
    assert found.converged[0, ~failed].all()
    assert found.converged[1].all()


def test_the_group_holds_values_in_the_parameters_units() -> None:
    space = ParameterSpace(
        (Parameter("k", "N/m", 1.0, 100.0, 10.0, "log"), Parameter("d", "N s/m", -2.0, 2.0, 0.0))
    )  # fmt: skip
    found = profile(Gaussian([0.5, 0.25], np.eye(2) / 0.05**2), [0.5, 0.25], [0.05, 0.05], points=3, reach=2.0)
    group = profile_group("/modes/m1/profile", space, found)
    assert group["value"].dims == group["neg_log_posterior"].dims == ("parameter", "point")
    np.testing.assert_allclose(group["value"].sel(parameter="k"), 100.0 ** np.array([0.4, 0.5, 0.6]))
    np.testing.assert_allclose(group["value"].sel(parameter="d"), [-1.4, -1.0, -0.6])
    np.testing.assert_allclose(group["neg_log_posterior"], [[2.0, 0.0, 2.0]] * 2, atol=1e-9)
    assert all(group[name].attrs["units"] and group[name].attrs["long_name"] for name in group.data_vars)
