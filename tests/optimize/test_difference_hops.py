"""Hops by the differences between local minima."""

import numpy as np
import pytest

from mofit.errors import InputError
from mofit.optimize.difference_hops import Hops, HopSettings

BOTTOM = np.array([0.37, 0.62])
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])


def lattice(u):
    """Narrow minima in a turned lattice, the deeper the nearer to the bottom."""
    z = (u - BOTTOM) @ TURN / 0.02
    return np.abs(np.sin(np.pi * z)).sum(axis=1) + ((u - BOTTOM) ** 2).sum(axis=1)


def nowhere(u):
    return np.zeros(len(u), dtype=bool)


def rounds(count, attracts=nowhere, seed=0):
    hops = Hops(lattice, 2, np.random.default_rng(seed), HopSettings())
    return [hops.round(0.0, np.empty((0, 2)), attracts) for _ in range(count)]


def test_chains_lead_to_the_deepest_minimum_of_a_lattice():
    for seed in range(3):
        points = np.concatenate([points for points, _ in rounds(2, seed=seed)])
        assert np.linalg.norm(points - BOTTOM, axis=1).min() < 1e-3


def test_steps_are_short_beside_the_period():
    points, steps = rounds(1)[0]
    assert len(points) == len(steps) > 0
    assert np.all((steps > 0) & (steps < 0.02))


def test_what_a_known_minimum_attracts_is_not_returned():
    points, _ = rounds(1, lambda u: np.ones(len(u), dtype=bool))[0]
    assert len(points) == 0


def test_sites_in_a_known_valley_are_left_out():
    hops = Hops(lattice, 2, np.random.default_rng(0), HopSettings(sites=1))
    minima, _ = hops.round(0.0, np.empty((0, 2)), nowhere)
    assert minima == pytest.approx(BOTTOM[None], abs=1e-3)
    first = hops.tried.copy()
    hops.round(0.0, minima, nowhere)
    later = hops.tried.copy()
    later[: len(first)] &= ~first
    width = np.linalg.norm(hops.points[: len(first)][first] - minima, axis=1)
    assert np.all(np.linalg.norm(hops.points[later] - minima, axis=1) >= width)


def test_equal_seeds_hop_the_same():
    first, again, other = (rounds(1, seed=seed)[0][0] for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_budget_that_ends_ends_the_hops():
    left = [500]

    def limited(u):
        some = u[: left[0]]
        left[0] -= len(some)
        return lattice(some)

    hops = Hops(limited, 2, np.random.default_rng(0), HopSettings())
    points, steps = hops.round(0.0, np.empty((0, 2)), nowhere)
    assert len(points) == len(steps)


def test_wrong_settings_are_said():
    with pytest.raises(InputError, match="share"):
        HopSettings(share=1.0)
