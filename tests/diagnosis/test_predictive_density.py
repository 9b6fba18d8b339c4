"""How probable tests left out are: against the density of a normal distribution, written out."""

from types import SimpleNamespace

import numpy as np
import pytest
from damper_rig import damper_fit
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from mofit.diagnosis.predictive_density import deviance


def minus_twice_log_density(error, spread):
    """Up to the constant of the normal density."""
    density = multivariate_normal(np.zeros(len(error)), spread).logpdf(error)
    return -2 * density - len(error) * np.log(2 * np.pi)


@pytest.mark.parametrize("size", [1.0, 3.0])
def test_deviance_is_that_of_the_normal_predictive_density(size):
    fitted = damper_fit()
    observed, tests = fitted.hypothesis.observed, (1,)
    here = np.isin(observed.test, tests)
    kept = fitted.design
    kept[: len(here)][here] = 0.0
    covariance = np.linalg.inv(kept.T @ kept)
    rows = np.flatnonzero(here & observed.explainable)
    response = fitted.jacobian[rows][:, fitted.free]
    spread = np.eye(len(rows)) + response @ covariance @ response.T
    assert np.linalg.eigvalsh(spread)[-1] > 1.1  # the other tests leave something to be estimated
    found = deviance(fitted, tests, size * fitted.residual, fitted.jacobian)
    assert found == pytest.approx(minus_twice_log_density(size * fitted.residual[rows], spread))


def test_what_a_test_tells_of_its_own_parameters_does_not_count():
    random = np.random.default_rng(1)
    test, only_test = np.repeat([0, 1], 12), np.array([-1, 1, -1])
    jacobian = random.standard_normal((24, 3))
    jacobian[test == 0, 1] = 0.0
    fitted = SimpleNamespace(
        hypothesis=SimpleNamespace(
            observed=SimpleNamespace(test=test, explainable=np.ones(24, dtype=bool)),
            layout=SimpleNamespace(only_test=only_test),
        ),
        free=np.ones(3, dtype=bool),
        design=np.concatenate([-jacobian, np.eye(3)]),
    )
    residual = random.standard_normal(24)
    other, own, theirs = jacobian[test == 0], jacobian[test == 1][:, [1]], jacobian[test == 1][:, [0, 2]]
    covariance = np.linalg.inv(other[:, [0, 2]].T @ other[:, [0, 2]] + np.eye(2))
    across = null_space(own.T)
    spread = np.eye(11) + across.T @ theirs @ covariance @ theirs.T @ across
    expected = minus_twice_log_density(across.T @ residual[test == 1], spread)
    assert deviance(fitted, (1,), residual, jacobian) == pytest.approx(expected)
    moved = residual + 50.0 * jacobian[:, 1]
    assert deviance(fitted, (1,), moved, jacobian) == pytest.approx(expected)
