"""What a step promises is that of the exact minimiser in the box; bounded least squares by SciPy is the peer."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from mofit.optimize.box_minimum import box_minimum
from mofit.optimize.trust_region_step import curvature_scale

REACH = 0.25


def model(slopes, residual, damping, step):
    """Half the squares of the linear residual, damped, less those without a step."""
    hessian = slopes.T @ slopes
    damped = hessian + damping * np.diag(curvature_scale(hessian[None])[0])
    return residual @ slopes @ step + 0.5 * step @ damped @ step


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(-9, 0), st.booleans())
def test_no_step_in_the_box_is_lower(seed, size, damping, alike):
    rng, damping = np.random.default_rng(seed), 10.0**damping
    count = 3
    slopes = rng.normal(size=(count, size + 2, size)) * 10 ** rng.uniform(-3, 4, size=(count, 1, size))
    if alike and size > 1:  # two parameters that do about the same
        slopes[:, :, 0] = 1.0001 * slopes[:, :, 1]
    residual = rng.normal(size=(count, size + 2)) * 10 ** rng.uniform(0, 3)
    points = np.clip(rng.uniform(-0.3, 1.3, size=(count, size)), 0, 1)
    gradients, hessians = np.einsum("kri,kr->ki", slopes, residual), slopes.transpose(0, 2, 1) @ slopes
    steps, falls = box_minimum(points, gradients, hessians, np.full(count, damping), REACH)
    for point, own, left, step, fall in zip(points, slopes, residual, steps, falls, strict=True):
        low, high = np.maximum(-point, -REACH), np.minimum(1 - point, REACH)
        assert np.all((step >= low - 1e-12) & (step <= high + 1e-12))
        scale = np.sqrt(damping * np.maximum(np.sum(own**2, axis=0), 1))
        rows, wanted = np.concatenate([own, np.diag(scale)]), np.concatenate([-left, np.zeros(size)])
        # the peer wants some room between the bounds
        expected = lsq_linear(rows, wanted, (low - 1e-12, high + 1e-12), method="bvls", tol=1e-14, max_iter=1000).x
        lowest = model(own, left, damping, np.clip(expected, low, high))
        assert model(own, left, damping, step) <= lowest + 1e-6 * abs(lowest) + 1e-9
        undamped = model(own, left, 0.0, step)
        np.testing.assert_allclose(fall, -undamped, rtol=1e-6, atol=1e-9)
        assert fall >= -1e-9 * abs(undamped)


def test_derivatives_of_all_sizes_are_no_error():
    sizes = np.array([1e-20, 1.0, 1e30])
    slopes = np.random.default_rng(0).normal(size=(5, 3)) * sizes
    residual = np.ones(5)
    step, fall = box_minimum(
        np.full((1, 3), 0.5), (residual @ slopes)[None], (slopes.T @ slopes)[None], np.array([1e-9]), REACH
    )
    assert np.all(np.isfinite(step))
    assert 0 < fall[0] <= 0.5 * residual @ residual
