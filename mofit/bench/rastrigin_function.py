"""Rastrigin's function on [-2, 2]^d as in the paper, plain or shifted and rotated, and where its minima are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.stats import ortho_group

from mofit.parameters import Array

#: Half the width of the domain.
HALF = 2.0


@dataclass(frozen=True)
class Rastrigin:
    r"""Objective in the unit cube.

    .. math:: f(z) = \sum_i z_i^2 + 10\,(1 - \cos 2\pi z_i), \qquad z = R\,(4 u - 2 - s)

    Parameters
    ----------
    shift
        s, shape (d,).
    rotation
        R, shape (d, d).
    """

    shift: Array
    rotation: Array

    @classmethod
    def plain(cls, dimension: int = 2) -> Rastrigin:
        """The function of Hackl et al. 2016: 5^d minima in the box."""
        return cls(np.zeros(dimension), np.eye(dimension))

    @classmethod
    def turned(cls, rng: np.random.Generator, dimension: int = 2) -> Rastrigin:
        """Shifted by up to half the domain and rotated at random, so that no lattice or axis helps."""
        rotation = ortho_group.rvs(dimension, random_state=rng)
        return cls(rng.uniform(-HALF / 2, HALF / 2, dimension), rotation)

    def _inner(self, u: Array) -> Array:
        return np.asarray((2 * HALF * u - HALF - self.shift) @ self.rotation.T)

    def value(self, u: Array) -> Array:
        """Shape (N, 1)."""
        z = self._inner(u)
        return np.asarray(np.sum(z**2 + 10 * (1 - np.cos(2 * np.pi * z)), axis=1, keepdims=True))

    def gradient(self, u: Array) -> tuple[Array, Array]:
        """Value (N, 1) and gradient (N, 1, d)."""
        z = self._inner(u)
        slope = (2 * z + 20 * np.pi * np.sin(2 * np.pi * z)) @ self.rotation * 2 * HALF
        return self.value(u), slope[:, None, :]

    def scaled(self, u: Array) -> Array:
        """Points of the unit cube in the units of the domain."""
        return 2 * HALF * u - HALF

    @cached_property
    def minima(self) -> Array:
        """All minima inside the box in the units of the domain, the global one first."""
        dimension = len(self.shift)
        reach = int(np.ceil(2 * HALF * np.sqrt(dimension))) + 1
        line = _minima_on_a_line(reach)
        lattice = np.array(list(product(line, repeat=dimension)))
        lattice = lattice[np.argsort(np.sum(lattice**2, axis=1), kind="stable")]
        placed = lattice @ self.rotation + self.shift
        return np.asarray(placed[np.all(np.abs(placed) <= HALF, axis=1)])


def _minima_on_a_line(reach: int) -> Array:
    """Minima of z^2 + 10 (1 - cos 2 pi z), by Newton's method from the integers."""
    z = np.arange(-reach, reach + 1, dtype=float)
    for _ in range(50):
        z -= (2 * z + 20 * np.pi * np.sin(2 * np.pi * z)) / (2 + 40 * np.pi**2 * np.cos(2 * np.pi * z))
    return z


def found(answers: Array, minima: Array, tolerance: float) -> int:
    """How many minima have an answer within the tolerance."""
    if len(answers) == 0:
        return 0
    gaps = np.linalg.norm(answers[:, None] - minima[None], axis=-1)
    return int(np.sum(gaps.min(axis=0) <= tolerance))
