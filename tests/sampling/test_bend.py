"""Bent posteriors: a shear that is known, and a heavy-tailed one whose moments are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.sampling import laplace_covariance, sample_mode
from mofit.sampling.bend import fitted_bend
from mofit.sampling.independence_proposal import best_proposal, predicted_time

SD = np.array([0.04, 0.02, 0.001])
BEND, FREEDOM = 3.0, 5.0


def draws(count: int, seed: int) -> np.ndarray:
    """Student-t draws whose narrow third direction follows the square of the wide first one."""
    rng = np.random.default_rng(seed)
    straight = rng.standard_normal((count, 3)) * SD / np.sqrt(rng.chisquare(FREEDOM, (count, 1)) / FREEDOM)
    return 0.5 + straight + np.array([0, 0, BEND]) * straight[:, :1] ** 2


@given(st.integers(0, 1000), st.sampled_from([1, 2]))
def test_a_bend_is_undone_and_keeps_volumes(seed, wide):
    points = draws(500, seed)
    bend = fitted_bend(points, wide)
    assert bend.wide == wide
    assert bend.bent(bend.straight(points)) == pytest.approx(points, abs=1e-9)
    steps = 1e-6 * np.eye(3)
    slopes = (bend.straight(points[0] + steps) - bend.straight(points[0] - steps)) / 2e-6
    assert abs(np.linalg.det(slopes)) == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize("wide", [1, 2])
def test_a_known_bend_is_found(wide):
    points = draws(4000, 1)
    straight = fitted_bend(points, wide).straight(points)
    assert np.corrcoef(points[:, 2], points[:, 0])[0, 1] < 0.5  # no straight line shows it
    middle = np.median(np.abs(straight - np.median(straight, axis=0)), axis=0)
    assert middle.min() < 1.2 * 0.73 * SD[2]  # median of |t| with 5 degrees of freedom


def test_too_few_draws_have_no_bend():
    assert fitted_bend(draws(50, 0), 2) is None
    assert fitted_bend(draws(50, 0), 1) is not None


def test_few_draws_of_many_directions_show_a_bend_along_the_widest():
    """With 700 draws a bend along all sixteen would have too many terms."""
    sd, bend = np.geomspace(0.1, 1e-3, 16), np.zeros(16)
    bend[9] = 1.5 * sd[9] / sd[0] ** 2

    def drawn(count, seed):
        straight = sd * np.random.default_rng(seed).standard_normal((count, 16))
        return 0.5 + straight + bend * straight[:, :1] ** 2, -0.5 * np.sum((straight / sd) ** 2, axis=1)

    proposal, promised = best_proposal(*drawn(700, 1))
    assert proposal.bend.wide < 4
    assert max(promised, predicted_time(proposal, *drawn(4000, 2))) < 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_bent_needle_with_heavy_tails_is_sampled(seed):
    """One standard deviation along it, it lies six of its narrowest width beside the straight line."""
    sd, freedom = np.array([0.042, 0.024, 0.016, 0.01, 0.004, 0.001, 0.0003]), 4.0
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(7, 7)))[0]

    def straight(points):
        along = (points - 0.5) @ axes
        along[:, 4:] += along[:, :1] ** 2
        return along / sd

    def log_posterior(points):
        return -(freedom + 7) / 2 * np.log1p(np.sum(straight(points) ** 2, axis=1) / freedom)

    hessian = (freedom + 7) / freedom * (axes / sd**2) @ axes.T
    chains = sample_mode(log_posterior, np.full(7, 0.5), laplace_covariance(hessian), seed)
    assert chains.converged
    found = np.median(np.abs(straight(chains.thinned().points.reshape(-1, 7))), axis=0)
    assert found[4:] == pytest.approx(np.full(3, 0.741), rel=0.15)  # median of |t| with 4 degrees of freedom
