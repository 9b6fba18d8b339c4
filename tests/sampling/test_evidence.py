"""Evidence of a mode against analytic integrals and quadrature over the box."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

from mofit.sampling import laplace_log_evidence, mode_weights


@given(st.integers(0, 1000), st.integers(1, 8))
@settings(max_examples=20, deadline=None)
def test_inside_the_box_it_is_laplaces_formula(seed, dimension):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(dimension, dimension)) + 2 * np.eye(dimension)
    hessian = 1e6 * (root @ root.T / dimension + np.eye(dimension))
    exact = -3.0 + dimension / 2 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(hessian)[1]
    assert laplace_log_evidence(3.0, hessian, np.full(dimension, 0.5)) == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize(
    ("point", "gradient", "hessian"),
    [
        ([0.0, 0.5], [0.0, 0.0], [[400.0, 0.0], [0.0, 100.0]]),  # half of it lies outside
        ([0.0, 0.4], [60.0, 0.0], [[50.0, 30.0], [30.0, 200.0]]),  # falls towards the face
        ([1.0, 0.0], [-20.0, 5.0], [[30.0, 10.0], [10.0, 40.0]]),  # a corner
        ([0.3, 0.7], [0.0, 0.0], [[200.0, 200.0], [200.0, 200.0]]),  # a ridge across the box
        ([0.5, 0.5], [0.0, 0.0], [[0.0, 0.0], [0.0, 0.0]]),  # nothing known
        ([0.0, 0.2], [3.0, 0.0], [[0.0, 0.0], [0.0, 500.0]]),  # linear in one direction
    ],
)
def test_faces_and_flat_directions_agree_with_quadrature(point, gradient, hessian):
    point, gradient, hessian = (np.array(part) for part in (point, gradient, hessian))

    def density(y, x):
        gap = np.array([x, y]) - point
        return np.exp(-gradient @ gap - 0.5 * gap @ hessian @ gap)

    exact = np.log(dblquad(density, 0, 1, 0, 1, epsabs=1e-9)[0])
    assert laplace_log_evidence(0.0, hessian, point, gradient) == pytest.approx(exact, abs=5e-3)


def test_weights_are_shares_and_do_not_overflow():
    np.testing.assert_allclose(mode_weights([-5000.0, -5000.0 + np.log(3), -9000.0]), [0.25, 0.75, 0.0])


def test_the_mass_of_a_ridge_is_that_of_its_width(rng):
    """Curvatures of 1e14 across and none along: the integral is the one of the Gaussian across, times the box."""
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    across = turn[:, 2] / np.abs(turn[:, 2]).max()
    hessian = 1e14 * np.outer(across, across)
    width = np.sqrt(2 * np.pi / (hessian.trace()))
    plane = np.sqrt(across @ across)  # area of the box's cut is at most that of its diagonal plane
    found = np.exp(laplace_log_evidence(0.0, hessian, np.full(3, 0.5)))
    assert 0.3 * width < found < 1.8 * width * plane
