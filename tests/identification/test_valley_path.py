"""Sampling along a curved valley: the sum of two positive parameters on log scales, against quadrature."""

import numpy as np
import pytest

from mofit.identification.valley_path import along_valley
from mofit.sampling import SampleSettings, laplace_covariance, sample_mode

SUM, SD = 1.0, 0.01
LOWER, DECADES = -4.0, 5.0


def values(u):
    """From 1e-4 to 10, on log scales."""
    return 10 ** (LOWER + DECADES * u)


def terms(u):
    """Of a measured sum of the first two parameters, and of a third one."""
    a = values(u[:, :2])
    miss = np.stack([(a.sum(axis=1) - SUM) / SD, (u[:, 2] - 0.4) / 0.02], axis=1)
    slopes = np.zeros((len(u), 2, 3))
    slopes[:, 0, :2], slopes[:, 1, 2] = a * DECADES * np.log(10) / SD, 1 / 0.02
    return (
        0.5 * np.sum(miss**2, axis=1),
        np.einsum("nk,nkd->nd", miss, slopes),
        np.einsum("nkd,nke->nde", slopes, slopes),
    )


def minimum(first):
    """The sum's valley where the first parameter has the value ``first``."""
    point = np.append((np.log10([first, SUM - first]) - LOWER) / DECADES, 0.4)
    return point, terms(point[None])[2][0]


def quadrature(n=2000):
    """Share of the posterior in which the first parameter, and in which the second one, is below a tenth of the sum."""
    u = (np.arange(n) + 0.5) / n
    a = values(u)
    weight = np.exp(-0.5 * ((a[:, None] + a - SUM) / SD) ** 2)
    return weight[a < 0.1 * SUM].sum() / weight.sum(), weight[:, a < 0.1 * SUM].sum() / weight.sum()


@pytest.mark.parametrize("first", [0.5, 0.02, 0.98])
def test_the_chains_cover_both_arms_of_a_sum(first):
    point, hessian = minimum(first)
    valley = along_valley(terms, point, hessian)
    chains = sample_mode(
        lambda u: -terms(u)[0],
        point,
        laplace_covariance(hessian),
        seed=1,
        settings=SampleSettings(max_steps=3000),
        valley=valley,
    )
    assert chains.converged
    draws = values(chains.thinned().points.reshape(-1, 3)[:, :2])
    assert np.mean(draws < 0.1 * SUM, axis=0) == pytest.approx(quadrature(), abs=0.04)
    np.testing.assert_allclose(draws.sum(axis=1), SUM, atol=6 * SD)


@pytest.mark.slow
def test_without_the_valley_they_do_not():
    point, hessian = minimum(0.02)
    settings = SampleSettings(max_steps=3000)
    assert not sample_mode(lambda u: -terms(u)[0], point, laplace_covariance(hessian), 1, settings).converged


def test_where_all_is_determined_or_the_valley_is_straight_there_is_none():
    def straight(u):
        slopes = np.array([[30.0, 30.0]])
        miss = (u - 0.5) @ slopes.T
        return 0.5 * np.sum(miss**2, axis=1), miss @ slopes, np.tile(slopes.T @ slopes, (len(u), 1, 1))

    assert along_valley(straight, np.full(2, 0.5), straight(np.full((1, 2), 0.5))[2][0]) is None
    point, hessian = minimum(0.5)
    assert along_valley(terms, point, hessian + 1e4 * np.eye(3)) is None
