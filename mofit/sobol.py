"""Sobol points: they fill the unit cube more evenly than random draws.

The numbers are those of `scipy.stats.qmc.Sobol`, bit for bit (tested); importing that takes longer than the search.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bits = NDArray[np.int64]

#: binary digits of a coordinate
_DIGITS = 30


class Sequence(Protocol):
    """Points of the unit cube, some more at each call."""

    def random(self, count: int, /) -> Array:
        """The next points, shape (count, d)."""
        ...


def sobol(dimension: int, rng: np.random.Generator | int | None = None) -> Sequence:
    """A Sobol sequence.

    Parameters
    ----------
    dimension
        Number of coordinates, d.
    rng
        Scrambles the sequence: a seed, or a generator of which a child is taken; None leaves it as it is.
    """
    if dimension > len(_DIRECTIONS):
        from scipy.stats import qmc

        return qmc.Sobol(dimension, scramble=rng is not None, rng=rng)
    return Sobol(dimension, rng)


class Sobol:
    r"""The sequence :math:`x_i = s \oplus \bigoplus_b g_b(i)\, v_b` with Gray code g and direction numbers v.

    Scrambled as by Matoušek: v multiplied by a random lower triangular binary matrix, and a random shift s.

    References
    ----------
    Joe, Kuo: Constructing Sobol sequences with better two-dimensional projections (2008). Matoušek: On the
    L2-discrepancy for anchored boxes (1998).
    """

    def __init__(self, dimension: int, rng: np.random.Generator | int | None = None) -> None:
        digits = np.array([_digits(*direction) for direction in _DIRECTIONS[:dimension]])
        shift = np.zeros((dimension, _DIGITS), dtype=np.int64)
        if rng is not None:
            own = np.random.default_rng(rng).spawn(1)[0]
            # the shift's digits are drawn with the last one first
            shift = own.integers(2, size=shift.shape, dtype=np.uint32).astype(np.int64)[:, ::-1]
            mixing = np.tril(own.integers(2, size=(dimension, _DIGITS, _DIGITS), dtype=np.uint32)).astype(np.int64)
            mixing[:, range(_DIGITS), range(_DIGITS)] = 1
            digits = digits @ mixing.transpose(0, 2, 1) % 2
        value = 1 << np.arange(_DIGITS)[::-1]
        self._directions, self._shift = digits @ value, shift @ value
        self._drawn = 0

    def random(self, count: int) -> Array:
        """The next points, shape (count, d)."""
        number = np.arange(self._drawn, self._drawn + count)
        self._drawn += count
        gray = number ^ (number >> 1)
        points = np.tile(self._shift, (count, 1))
        for digit in range(int(self._drawn).bit_length()):
            points ^= (gray >> digit & 1)[:, None] * self._directions[:, digit]
        return np.asarray(points * 2.0**-_DIGITS)


def _digits(polynomial: int, first: tuple[int, ...]) -> Bits:
    """Direction numbers of one coordinate, shape (number, digit), the most significant digit first."""
    degree = polynomial.bit_length() - 1
    numbers = list(first)
    for j in range(len(first), _DIGITS):
        new = numbers[j - degree]
        for k in range(degree):
            if polynomial >> (degree - 1 - k) & 1:
                new ^= numbers[j - k - 1] << (k + 1)
        numbers.append(new)
    whole = np.array([number << (_DIGITS - 1 - j) for j, number in enumerate(numbers)])
    return whole[:, None] >> np.arange(_DIGITS)[::-1] & 1


#: Joe and Kuo's table: primitive polynomial and first direction numbers of every coordinate
_DIRECTIONS: tuple[tuple[int, tuple[int, ...]], ...] = (
    (1, (1,) * _DIGITS),
    (3, (1,)),
    (7, (1, 3)),
    (11, (1, 3, 1)),
    (13, (1, 1, 1)),
    (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)),
    (37, (1, 1, 5, 5, 17)),
    (41, (1, 1, 5, 5, 5)),
    (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)),
    (59, (1, 1, 1, 3, 11)),
    (61, (1, 3, 5, 5, 31)),
    (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)),
    (97, (1, 3, 1, 13, 27, 49)),
    (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)),
    (115, (1, 1, 5, 5, 19, 61)),
    (131, (1, 3, 7, 11, 23, 15, 103)),
    (137, (1, 3, 7, 13, 13, 15, 69)),
    (143, (1, 1, 3, 13, 7, 35, 63)),
    (145, (1, 3, 5, 9, 1, 25, 53)),
    (157, (1, 3, 1, 13, 9, 35, 107)),
    (167, (1, 3, 1, 5, 27, 61, 31)),
    (171, (1, 1, 5, 11, 19, 41, 61)),
    (185, (1, 3, 5, 3, 3, 13, 69)),
    (191, (1, 1, 7, 13, 1, 19, 1)),
    (193, (1, 3, 7, 5, 13, 19, 59)),
    (203, (1, 1, 3, 9, 25, 29, 41)),
    (211, (1, 3, 5, 13, 23, 1, 55)),
    (213, (1, 3, 7, 3, 13, 59, 17)),
    (229, (1, 3, 1, 3, 5, 53, 69)),
    (239, (1, 1, 5, 5, 23, 33, 13)),
    (241, (1, 1, 7, 7, 1, 61, 123)),
    (247, (1, 1, 7, 9, 13, 61, 49)),
    (253, (1, 3, 3, 5, 3, 55, 33)),
    (285, (1, 3, 1, 15, 31, 13, 49, 245)),
    (299, (1, 3, 5, 15, 31, 59, 63, 97)),
    (301, (1, 3, 1, 11, 11, 11, 77, 249)),
)
