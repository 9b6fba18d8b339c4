"""The CEC 2013 niching benchmark, functions 1 to 10, with the official budgets, accuracies and count of optima.

Li, Engelbrecht and Epitropakis, "Benchmark functions for CEC'2013 special session and competition on niching methods
for multimodal function optimization", RMIT University 2013. Functions 11 to 20 are compositions whose rotation
matrices and optima come as data files with the official code; they are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from math import log, pi
from multiprocessing import get_context
from typing import Any

import casadi as ca
import numpy as np

from benchmarks import peers
from benchmarks.rows import KeptRows
from mofit._typing import FloatArray
from mofit.optimize.searches import mlsl
from studies.report_page import versions


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

    def scaled(self, u: FloatArray) -> FloatArray:
        """Points of the unit cube in the box."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        return np.asarray(lower + u * (upper - lower))

    def value(self, u: FloatArray) -> FloatArray:
        """Function at points of the unit cube, to be minimised, shape (N, 1)."""
        return self.gradient(u)[0]

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
)  # fmt: skip

ACCURACIES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
#: Of a search's minima, those whose value is so close to its best are reported as global.
GLOBAL = 1e-4
#: A function with this budget gets one run, a peer at most three: they take minutes each.
LARGE, FEW = 400_000, 3


@dataclass(frozen=True)
class Entry:
    """A competitor and the most runs it gets."""

    name: str
    search: peers.Search
    runs: int = 1000


def _mlsl(landscape: peers.Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> peers.Answer:
    """With its own stop rule, and the minima polished to the tightest accuracy."""
    settings = mlsl.MlslSettings(evaluations=budget, final_tolerance=1e-7)
    result = mlsl.search(landscape.value, landscape.gradient, dimension, rng, settings)
    best = result.archived_cost <= result.archived_cost.min() + GLOBAL
    return peers.Answer(result.archived_points[best], result.evaluations)


def _reported(search: peers.Search) -> peers.Search:
    """A peer of whose local minima those about as good as its best are reported, each once."""

    def run(landscape: peers.Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Any:
        answer = search(landscape, dimension, budget, rng, price)
        if len(answer.points) == 0:
            return answer
        cost = landscape.value(answer.points)[:, 0]
        kept: list[FloatArray] = []
        for k in np.argsort(cost, kind="stable"):
            if cost[k] > cost.min() + GLOBAL:
                break
            if all(np.linalg.norm(answer.points[k] - other) > 1e-3 for other in kept):
                kept.append(answer.points[k])
        return peers.Answer(np.array(kept), answer.spent)

    return run


ENTRIES = (
    Entry("mlsl", _mlsl),
    Entry("multi-start L-BFGS-B, Sobol", _reported(peers.multi_start), FEW),
    Entry("shgo, Sobol", _reported(peers.shgo), FEW),
    Entry("NicheGA (pymoo)", peers.niche_ga, FEW),
    Entry("Omni-optimizer (pymoo)", peers.omni, FEW),
)

PUBLISHED = {
    "RS-CMSA-ESII, HillVallEA19 (published)": "peak ratio 1.000 on functions 1 to 7 and 10 at all accuracies; mean "
    "over all 20 functions 0.906 and 0.892",
    "left out": "functions 11 to 20: their rotation matrices and optima are data files of the official code",
    "reported": f"minima within {GLOBAL:g} of the best; a gradient counts as one evaluation",
    "F1": "harmonic mean of peak ratio and of the share of reported points that are distinct global optima",
}


def run(runs: int = 50, seed: int = 0, jobs: int = 1) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All competitors on all functions.

    Parameters
    ----------
    runs
        Of MLSL on each function; peers get at most three, functions with a budget of 400,000 one.
    seed
        Of all runs; results do not depend on ``jobs``.
    jobs
        Processes.

    Returns
    -------
    rows
        One per function and competitor: peak ratio and F1 at each accuracy.
    settings
        What they were run with.
    """
    rows = KeptRows("cec2013", {"runs": runs, "seed": seed})
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for function in sorted(range(len(FUNCTIONS)), key=lambda k: FUNCTIONS[k].budget):  # the quick ones first
            for entry in range(len(ENTRIES)):
                most = min(runs, ENTRIES[entry].runs, 1 if FUNCTIONS[function].budget >= LARGE else runs)
                head = {"function": _label(FUNCTIONS[function]), "search": ENTRIES[entry].name, "runs": most}
                rows.add(head, partial(_all, pool, function, entry, seed, most))
    return rows.done(), {"runs": runs, "seed": seed, **versions("numpy", "scipy", "casadi"), **PUBLISHED}


def _all(pool: ProcessPoolExecutor, function: int, entry: int, seed: int, runs: int) -> dict[str, Any]:
    """Means over all runs of one competitor on one function."""
    return _scores(list(pool.map(partial(_single, function, entry, seed), range(runs))))


def _label(function: Niching) -> str:
    return f"{function.number} {function.name}"


def _single(function: int, entry: int, seed: int, number: int) -> tuple[int, list[float], list[float]]:
    """Evaluations, and peak ratio and F1 at every accuracy."""
    problem = FUNCTIONS[function]
    rng = np.random.default_rng([seed, function, number])
    answer = ENTRIES[entry].search(problem, problem.dimension, problem.budget, rng, 1)
    ratios, scores = [], []
    for accuracy in ACCURACIES:
        count = found_optima(problem, answer.points, accuracy)
        recall, precision = count / problem.optima, count / max(len(answer.points), 1)
        ratios.append(recall)
        scores.append(2 * recall * precision / (recall + precision) if count else 0.0)
    return answer.spent, ratios, scores


def _scores(results: list[tuple[int, list[float], list[float]]]) -> dict[str, float]:
    spent, ratios, scores = (np.mean([result[k] for result in results], axis=0) for k in range(3))
    return {
        "evaluations": float(spent),
        **{f"PR {a:g}": float(value) for a, value in zip(ACCURACIES, ratios, strict=True)},
        **{f"F1 {a:g}": float(value) for a, value in zip(ACCURACIES, scores, strict=True)},
    }
