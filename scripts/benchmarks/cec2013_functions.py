"""The twenty functions of the CEC 2013 niching benchmark, with the official budgets, accuracies and count of optima.

Li, Engelbrecht and Epitropakis, "Benchmark functions for CEC'2013 special session and competition on niching methods
for multimodal function optimization", RMIT University 2013. Rotation matrices and optima of the compositions, functions
11 to 20, are read from the package ``ioh``, which ships the official data files (BSD licence).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from math import log, pi
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.rows import Absent
from mofit._typing import FloatArray


@dataclass(frozen=True)
class Niching:
    """One function of the benchmark, to be maximised over a box.

    Parameters
    ----------
    number, name
        In the benchmark.
    expression
        Of the point (CasADi).
    lower, upper
        Bounds.
    best
        Value of the global maxima.
    optima
        Their number.
    radius
        Two solutions closer than this are one.
    budget
        Evaluations allowed.
    """

    number: int
    name: str
    expression: Callable[[ca.SX], ca.SX]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    best: float
    optima: int
    radius: float
    budget: int

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.lower)

    @cached_property
    def _compiled(self) -> ca.Function:
        x = ca.SX.sym("x", self.dimension)
        value = self.expression(x)
        return ca.Function("f", [x], [value, ca.gradient(value, x)])

    @cached_property
    def _value(self) -> ca.Function:
        x = ca.SX.sym("x", self.dimension)
        return ca.Function("f", [x], [self.expression(x)])

    def scaled(self, u: FloatArray) -> FloatArray:
        """Points of the unit cube in the box."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        return np.asarray(lower + u * (upper - lower))

    def value(self, u: FloatArray) -> FloatArray:
        """Function at points of the unit cube, to be minimised, shape (N, 1)."""
        return -np.array(self._value(self.scaled(u).T)).reshape(-1, 1) if len(u) else np.empty((0, 1))

    def gradient(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same and its gradient, (N, 1) and (N, 1, d)."""
        if len(u) == 0:
            return np.empty((0, 1)), np.empty((0, 1, self.dimension))
        value, slope = self._compiled(self.scaled(u).T)
        width = np.array(self.upper) - np.array(self.lower)
        return -np.array(value).reshape(-1, 1), -(np.array(slope).T * width)[:, None, :]


def found_optima(problem: Niching, u: FloatArray, accuracy: float) -> int:
    """Distinct global optima among solutions: the official count.

    Solutions are taken from the best to the worst; one that is within the niche radius of an earlier one is the same.
    """
    values = -problem.value(u)[:, 0]
    points = problem.scaled(u)
    seeds: list[FloatArray] = []
    count = 0
    for k in np.argsort(-values, kind="stable"):
        if problem.best - values[k] > accuracy or count == problem.optima:
            break
        if all(np.linalg.norm(points[k] - seed) > problem.radius for seed in seeds):
            seeds.append(points[k])
            count += 1
    return count


def _trap(x: ca.SX) -> ca.SX:
    """Five uneven peaks, by the largest of its rising and falling lines."""
    knots = (0.0, 2.5, 5.0, 7.5, 12.5, 17.5, 22.5, 27.5, 30.0)
    heights = (200.0, 0.0, 160.0, 0.0, 140.0, 0.0, 160.0, 0.0, 200.0)
    value = ca.SX(0)
    for k in range(len(knots) - 1):
        slope = (heights[k + 1] - heights[k]) / (knots[k + 1] - knots[k])
        here = ca.logic_and(x >= knots[k], x < knots[k + 1] if k < len(knots) - 2 else x <= knots[k + 1])
        value = ca.if_else(here, heights[k] + slope * (x - knots[k]), value)
    return value


def _uneven(x: ca.SX) -> ca.SX:
    return ca.exp(-2 * log(2) * ((x - 0.08) / 0.854) ** 2) * ca.sin(5 * pi * (x**0.75 - 0.05)) ** 6


def _camel(x: ca.SX) -> ca.SX:
    a, b = x[0], x[1]
    return -((4 - 2.1 * a**2 + a**4 / 3) * a**2 + a * b + (4 * b**2 - 4) * b**2)


def _shubert(x: ca.SX) -> ca.SX:
    value = ca.SX(-1)
    for i in range(x.numel()):
        value *= sum(j * ca.cos((j + 1) * x[i] + j) for j in range(1, 6))
    return value


def _vincent(x: ca.SX) -> ca.SX:
    return ca.sum1(ca.sin(10 * ca.log(x))) / x.numel()


def _rastrigin(x: ca.SX) -> ca.SX:
    return -(10 + 9 * ca.cos(2 * pi * 3 * x[0])) - (10 + 9 * ca.cos(2 * pi * 4 * x[1]))


#: Height of every part of a composition at the reference point (5, ..., 5).
_HEIGHT = 2000.0


def _data(name: str) -> FloatArray:
    """Numbers of an official data file."""
    spec = find_spec("ioh")
    if spec is None or spec.origin is None:
        raise Absent("ioh is not installed (extra 'bench')")
    return np.loadtxt(Path(spec.origin).parent / "static" / "cec_transformations" / "2013" / name)


def _composition(kind: int, x: ca.SX) -> ca.SX:
    r"""Weighted sum of shifted, scaled and rotated functions, each with its optimum at 0.

    .. math:: -\sum_i w_i\, 2000\, f_i(z_i) / f_i(5 M_i / \lambda_i), \qquad z_i = (x - o_i) M_i / \lambda_i
    """
    functions, scales, widths, rotated = _COMPOSITIONS[kind]
    count, dimension = len(functions), x.numel()
    optima = _data("optima.dat").reshape(-1, 100)[:count, :dimension]
    identity = np.tile(np.eye(dimension), (count, 1, 1))
    matrices = _data(f"CF{kind}_M_D{dimension}.dat").reshape(-1, dimension, dimension) if rotated else identity
    offsets = [x - ca.DM(optimum) for optimum in optima]
    closeness = [
        ca.exp(-ca.sumsqr(offset) / (2 * dimension * width**2)) for offset, width in zip(offsets, widths, strict=True)
    ]
    closest = ca.mmax(ca.vertcat(*closeness))
    weights = [ca.if_else(near == closest, near, near * (1 - closest**10)) for near in closeness]
    total = ca.SX(0)
    for k, function in enumerate(functions):
        turned = ca.DM(matrices[k].T) / scales[k]
        height = function(turned @ ca.DM.ones(dimension) * 5)
        total += weights[k] * _HEIGHT * function(turned @ offsets[k]) / height
    return -total / sum(weights)


def _sphere(z: ca.SX) -> ca.SX:
    return ca.sumsqr(z)


def _rastrigin_part(z: ca.SX) -> ca.SX:
    return ca.sum1(z**2 - 10 * ca.cos(2 * pi * z) + 10)


def _griewank(z: ca.SX) -> ca.SX:
    product = 1.0
    for i in range(z.numel()):
        product *= ca.cos(z[i] / (i + 1) ** 0.5)
    return ca.sumsqr(z) / 4000 - product + 1


def _weierstrass(z: ca.SX) -> ca.SX:
    value = 0.0
    for k in range(21):
        value += 0.5**k * (ca.sum1(ca.cos(2 * pi * 3**k * (z + 0.5))) - z.numel() * np.cos(pi * 3**k))
    return value


def _expanded(z: ca.SX) -> ca.SX:
    """Griewank's function of Rosenbrock's, over all neighbouring pairs of coordinates."""
    value = 0.0
    for i in range(z.numel()):
        a, b = z[i] + 1, z[(i + 1) % z.numel()] + 1
        inner = 100 * (a**2 - b) ** 2 + (1 - a) ** 2
        value += 1 + inner**2 / 4000 - ca.cos(inner)
    return value


#: Per composition: its functions, their scales and widths, and whether they are rotated.
_COMPOSITIONS = {
    1: ((_griewank,) * 2 + (_weierstrass,) * 2 + (_sphere,) * 2, (1, 1, 8, 8, 1 / 5, 1 / 5), (1,) * 6, False),
    2: (
        (_rastrigin_part,) * 2 + (_weierstrass,) * 2 + (_griewank,) * 2 + (_sphere,) * 2,
        (1, 1, 10, 10, 1 / 10, 1 / 10, 1 / 7, 1 / 7), (1,) * 8, False,
    ),
    3: (
        (_expanded,) * 2 + (_weierstrass,) * 2 + (_griewank,) * 2,
        (1 / 4, 1 / 10, 2, 1, 2, 5), (1, 1, 2, 2, 2, 2), True,
    ),
    4: (
        (_rastrigin_part,) * 2 + (_expanded,) * 2 + (_weierstrass,) * 2 + (_griewank,) * 2,
        (4, 1, 4, 1, 1 / 10, 1 / 5, 1 / 10, 1 / 40), (1, 1, 1, 1, 1, 2, 2, 2), True,
    ),
}  # fmt: skip


def _composed(number: int, kind: int, dimension: int, budget: int) -> Niching:
    optima = len(_COMPOSITIONS[kind][0])
    box = (-5.0,) * dimension, (5.0,) * dimension
    return Niching(
        number, f"composition {kind}, {dimension}-D", partial(_composition, kind), *box, 0.0, optima, 0.01, budget
    )


FUNCTIONS = (
    Niching(1, "five uneven peak trap", _trap, (0.0,), (30.0,), 200.0, 2, 0.01, 50_000),
    Niching(2, "equal maxima", lambda x: ca.sin(5 * pi * x) ** 6, (0.0,), (1.0,), 1.0, 5, 0.01, 50_000),
    Niching(3, "uneven decreasing maxima", _uneven, (0.0,), (1.0,), 1.0, 1, 0.01, 50_000),
    Niching(
        4, "Himmelblau", lambda x: 200 - (x[0] ** 2 + x[1] - 11) ** 2 - (x[0] + x[1] ** 2 - 7) ** 2,
        (-6.0, -6.0), (6.0, 6.0), 200.0, 4, 0.01, 50_000,
    ),
    Niching(5, "six-hump camel back", _camel, (-1.9, -1.1), (1.9, 1.1), 1.031628453489877, 2, 0.5, 50_000),
    Niching(6, "Shubert 2-D", _shubert, (-10.0,) * 2, (10.0,) * 2, 186.7309088310240, 18, 0.5, 200_000),
    Niching(7, "Vincent 2-D", _vincent, (0.25,) * 2, (10.0,) * 2, 1.0, 36, 0.2, 200_000),
    Niching(8, "Shubert 3-D", _shubert, (-10.0,) * 3, (10.0,) * 3, 2709.093505572820, 81, 0.5, 400_000),
    Niching(9, "Vincent 3-D", _vincent, (0.25,) * 3, (10.0,) * 3, 1.0, 216, 0.2, 400_000),
    Niching(10, "modified Rastrigin", _rastrigin, (0.0, 0.0), (1.0, 1.0), -2.0, 12, 0.01, 200_000),
    _composed(11, 1, 2, 200_000),
    _composed(12, 2, 2, 200_000),
    _composed(13, 3, 2, 200_000),
    _composed(14, 3, 3, 400_000),
    _composed(15, 4, 3, 400_000),
    _composed(16, 3, 5, 400_000),
    _composed(17, 4, 5, 400_000),
    _composed(18, 3, 10, 400_000),
    _composed(19, 4, 10, 400_000),
    _composed(20, 4, 20, 400_000),
)  # fmt: skip
