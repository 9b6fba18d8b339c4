"""Other global searches on a function of the unit cube, each held to the same budget."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy import optimize
from scipy.stats import qmc

from benchmarks.rows import imported
from mofit._typing import FloatArray
from mofit.optimize.searches import effa, effa_2016, surrogate
from mofit.optimize.searches import mlsl as own_mlsl


class Landscape(Protocol):
    """A function to be minimised over the unit cube, with its exact gradient."""

    def value(self, u: FloatArray) -> FloatArray:
        """Shape (N, 1)."""
        ...

    def gradient(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shapes (N, 1) and (N, 1, d)."""
        ...


@dataclass(frozen=True)
class Answer:
    """What a search reports as minima, shape (n, d), and what it spent."""

    points: FloatArray
    spent: int


class Spent(Exception):
    """The budget is used up."""


#: Peers see the unit cube as [0, 60]^d: the first step of L-BFGS is one unit, and a longer one jumps out of its basin
#: (multi-start finds half as many of Rastrigin's minima on [-2, 2]^2).
WIDTH = 60.0


class Counted:
    """One point of [0, WIDTH]^d at a time, each evaluation counted; `Spent` is raised beyond the budget."""

    def __init__(self, landscape: Landscape, dimension: int, budget: int, gradient_cost: int = 1) -> None:
        self.landscape, self.dimension = landscape, dimension
        self.budget, self.gradient_cost = budget, gradient_cost
        self.bounds = [(0.0, WIDTH)] * dimension
        self.spent = 0
        self.best: tuple[float, FloatArray] = (np.inf, np.empty(0))

    def value(self, x: FloatArray) -> float:
        """Function at a point (d,)."""
        self._pay(1)
        return self._noted(float(self.landscape.value(x[None] / WIDTH)[0, 0]), x)

    def both(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Function and gradient at a point (d,)."""
        self._pay(self.gradient_cost)
        value, slope = self.landscape.gradient(x[None] / WIDTH)
        return self._noted(float(value[0, 0]), x), slope[0, 0] / WIDTH

    def slope(self, x: FloatArray) -> FloatArray:
        """Gradient at the point (d,) whose value has just been paid."""
        self._pay(self.gradient_cost - 1)
        return self.landscape.gradient(x[None] / WIDTH)[1][0, 0] / WIDTH

    def _pay(self, price: int) -> None:
        if self.spent + price > self.budget:
            raise Spent
        self.spent += price

    def _noted(self, value: float, x: FloatArray) -> float:
        if value < self.best[0]:
            self.best = value, x.copy()
        return value

    def answer(self, points: FloatArray) -> Answer:
        """Points (n, d) as shares of the box, with what has been spent."""
        return Answer(np.reshape(points, (-1, self.dimension)) / WIDTH, self.spent)


Search = Callable[[Landscape, int, int, np.random.Generator, int], Answer]
"""Landscape, dimension, budget, random numbers and the price of a gradient to an answer."""


def paper(landscape: Landscape, dimension: int, _: int, rng: np.random.Generator, __: int) -> Answer:
    """The paper's algorithm; its own budget."""
    result = effa_2016.search(landscape.value, landscape.gradient, dimension, rng)
    return Answer(result.archived_points, result.evaluations)


def by_mlsl(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Single linkage, made to use the whole budget."""
    settings = own_mlsl.MlslSettings(evaluations=budget, gradient_cost=price, undiscovered=None)
    result = own_mlsl.search(landscape.value, landscape.gradient, dimension, rng, settings)
    return Answer(result.archived_points, result.evaluations + (price - 1) * result.gradients)


def by_effa(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """The default search, made to use the whole budget."""
    return _effa(landscape, dimension, budget, rng, price)[0]


def by_swarm(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Of the default search, what the clusters of the swarm alone led to, and what was spent in all."""
    answer, found_by = _effa(landscape, dimension, budget, rng, price)
    return Answer(answer.points[[stage == "swarm" for stage in found_by]], answer.spent)


def _effa(
    landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int
) -> tuple[Answer, tuple[str, ...]]:
    default = effa.EffaSettings()
    completion = replace(default.completion, evaluations=budget, gradient_cost=price, undiscovered=None)
    settings = replace(default, completion=completion)
    result = effa.search(landscape.value, landscape.gradient, dimension, rng, settings)
    return Answer(result.archived_points, result.evaluations + (price - 1) * result.gradients), result.found_by


def by_surrogate(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """The search for expensive models."""
    result = surrogate.search(
        landscape.value, landscape.gradient, dimension, rng, surrogate.SurrogateSettings(evaluations=budget)
    )
    return Answer(result.archived_points, result.evaluations)


def multi_start(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """L-BFGS-B from one Sobol point after the other; every end counts."""
    counted, ends = Counted(landscape, dimension, budget, price), []
    starts = qmc.Sobol(dimension, scramble=True, rng=rng).random(2 ** int(np.ceil(np.log2(budget))))
    with suppress(Spent):
        for start in WIDTH * starts:
            end = optimize.minimize(counted.both, start, jac=True, method="L-BFGS-B", bounds=counted.bounds)
            ends.append(end.x)
    return counted.answer(np.array(ends))


#: A point of a local solver at which the gradient is below this share of the largest that was met is an end of it.
_FLAT = 1e-3


def mlsl(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Multi-level single linkage with L-BFGS (NLopt); every point where the gradient vanishes counts."""
    nlopt = imported("nlopt")
    counted, visited, slopes = Counted(landscape, dimension, budget, price), [], []

    def function(u: FloatArray, slope: FloatArray) -> float:
        try:
            if slope.size == 0:
                return counted.value(u)
            value, slope[:] = counted.both(u)
        except Spent:
            raise nlopt.ForcedStop from None  # the only exception that NLopt passes through
        visited.append(u.copy())
        slopes.append(np.linalg.norm(slope))
        return value

    nlopt.srand(int(rng.integers(2**31)))
    solver = nlopt.opt(nlopt.G_MLSL_LDS, dimension)
    local = nlopt.opt(nlopt.LD_LBFGS, dimension)
    local.set_xtol_rel(1e-4)
    solver.set_local_optimizer(local)
    solver.set_lower_bounds(np.zeros(dimension))
    solver.set_upper_bounds(np.full(dimension, WIDTH))
    solver.set_min_objective(function)
    with suppress(nlopt.ForcedStop, nlopt.runtime_error):  # the latter where the line search fails at the end
        solver.optimize(WIDTH * rng.random(dimension))
    points, sizes = np.array(visited).reshape(-1, dimension), np.array(slopes)
    return counted.answer(points[sizes < _FLAT * np.max(sizes, initial=0.0)])


def shgo(landscape: Landscape, dimension: int, budget: int, _: np.random.Generator, price: int) -> Answer:
    """Simplicial homology on 16, 32, ... 1,024 Sobol points (SciPy): of those within the budget, what finds most."""
    answer, most = Answer(np.empty((0, dimension)), 0), 0
    points = 16
    while points < min(budget, 1025):  # its triangulation takes minutes beyond
        counted = Counted(landscape, dimension, budget, price)
        with suppress(Spent):
            found = optimize.shgo(
                counted.value, counted.bounds, n=points, iters=1, sampling_method="sobol",
                options={"jac": counted.slope}, minimizer_kwargs={"method": "L-BFGS-B"},
            )  # fmt: skip
            distinct = len(np.unique(np.round(found.xl), axis=0)) if found.success else 0
            if distinct > most:
                answer, most = counted.answer(found.xl), distinct
        points *= 2
    return answer


def basin_hopping(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Basin hopping (SciPy) with L-BFGS-B; every local end counts."""
    counted, ends = Counted(landscape, dimension, budget, price), []
    local = {"method": "L-BFGS-B", "jac": True, "bounds": counted.bounds}
    with suppress(Spent):
        optimize.basinhopping(
            counted.both, WIDTH * rng.random(dimension), niter=budget, stepsize=WIDTH / 2, minimizer_kwargs=local,
            rng=rng, callback=lambda x, *_: ends.append(x),
        )  # fmt: skip
    return counted.answer(np.array(ends))


def differential_evolution(
    landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int
) -> Answer:
    """Differential evolution (SciPy); its best point counts."""
    counted = Counted(landscape, dimension, budget)
    with suppress(Spent):
        optimize.differential_evolution(counted.value, counted.bounds, rng=rng, maxiter=budget, polish=False, tol=0)
    return counted.answer(counted.best[1])


#: Of a population, those whose cost is within this share of its range above the best count as its optima.
_GOOD = 1e-3


def niche_ga(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """NicheGA (pymoo); its own list of optima counts."""
    algorithm = imported("pymoo.algorithms.soo.nonconvex.ga_niching").NicheGA(pop_size=100)
    found, spent = _run_pymoo(algorithm, landscape, dimension, budget, rng)
    return Answer(np.atleast_2d(found.opt.get("X")), spent)


def omni(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """Omni-optimizer (pymoo); the members of its last population that are about as good as the best count."""
    algorithm = imported("pymoo.algorithms.moo.omni").OmniOptimizer(pop_size=100)
    found, spent = _run_pymoo(algorithm, landscape, dimension, budget, rng)
    cost, points = found.pop.get("F")[:, 0], found.pop.get("X")
    return Answer(points[cost <= cost.min() + _GOOD * max(float(np.ptp(cost)), 1e-12)], spent)


def _run_pymoo(
    algorithm: Any, landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator
) -> tuple[Any, int]:
    """The finished run and its number of evaluations."""
    base = imported("pymoo.core.problem").Problem
    evaluate = {"_evaluate": lambda _, x, out, *__, **___: out.update(F=landscape.value(x))}
    task = type("Task", (base,), evaluate)(n_var=dimension, n_obj=1, xl=0.0, xu=1.0)
    minimise = imported("pymoo.optimize").minimize
    found = minimise(task, algorithm, ("n_eval", budget), seed=int(rng.integers(2**31)))
    return found, int(found.algorithm.evaluator.n_eval)
