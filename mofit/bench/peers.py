"""Other global searches on a function of the unit cube, each held to the same budget."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from scipy import optimize
from scipy.stats import qmc

from mofit.bench.competitors import Absent
from mofit.parameters import Array
from mofit.search import PAPER, NichingSettings, SurrogateSettings, effa, niching, surrogate


class Landscape(Protocol):
    """A function to be minimised over the unit cube, with its exact gradient."""

    def value(self, u: Array) -> Array:
        """Shape (N, 1)."""
        ...

    def gradient(self, u: Array) -> tuple[Array, Array]:
        """Shapes (N, 1) and (N, 1, d)."""
        ...


@dataclass(frozen=True)
class Answer:
    """What a search reports as minima, shape (n, d), and what it spent."""

    points: Array
    spent: int


class Spent(Exception):
    """The budget is used up."""


class Counted:
    """One point at a time, each evaluation counted; `Spent` is raised beyond the budget."""

    def __init__(self, landscape: Landscape, budget: int, gradient_cost: int = 1) -> None:
        self.landscape, self.budget, self.gradient_cost = landscape, budget, gradient_cost
        self.spent = 0
        self.best: tuple[float, Array] = (np.inf, np.empty(0))

    def value(self, u: Array) -> float:
        """Function at a point (d,)."""
        self._pay(1)
        return self._noted(float(self.landscape.value(u[None])[0, 0]), u)

    def both(self, u: Array) -> tuple[float, Array]:
        """Function and gradient at a point (d,)."""
        self._pay(self.gradient_cost)
        value, slope = self.landscape.gradient(u[None])
        return self._noted(float(value[0, 0]), u), slope[0, 0]

    def slope(self, u: Array) -> Array:
        """Gradient at the point (d,) whose value has just been paid."""
        self._pay(self.gradient_cost - 1)
        return self.landscape.gradient(u[None])[1][0, 0]

    def _pay(self, price: int) -> None:
        if self.spent + price > self.budget:
            raise Spent
        self.spent += price

    def _noted(self, value: float, u: Array) -> float:
        if value < self.best[0]:
            self.best = value, u.copy()
        return value


Search = Callable[[Landscape, int, int, np.random.Generator, int], Answer]
"""Landscape, dimension, budget, random numbers and the price of a gradient to an answer."""


def paper(landscape: Landscape, dimension: int, _: int, rng: np.random.Generator, __: int) -> Answer:
    """The paper's algorithm; its own budget."""
    result = effa(landscape.value, dimension, rng, PAPER)
    return Answer(result.stored_points, result.evaluations)


def by_niching(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """The default search, made to use the whole budget."""
    settings = NichingSettings(evaluations=budget, gradient_cost=price, unseen=None)
    result = niching(landscape.value, landscape.gradient, dimension, rng, settings)
    return Answer(result.stored_points, result.evaluations + (price - 1) * result.gradients)


def by_surrogate(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """The search for expensive models."""
    result = surrogate(landscape.value, dimension, rng, SurrogateSettings(evaluations=budget))
    return Answer(result.stored_points, result.evaluations)


def multi_start(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """L-BFGS-B from one Sobol point after the other; every end counts."""
    counted, ends = Counted(landscape, budget, price), []
    starts = qmc.Sobol(dimension, scramble=True, rng=rng).random(2 ** int(np.ceil(np.log2(budget))))
    with suppress(Spent):
        for start in starts:
            end = optimize.minimize(counted.both, start, jac=True, method="L-BFGS-B", bounds=[(0, 1)] * dimension)
            ends.append(end.x)
    return Answer(np.array(ends).reshape(-1, dimension), counted.spent)


#: A point of a local solver at which the gradient is below this share of the largest that was met is an end of it.
_FLAT = 1e-3


def mlsl(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Multi-level single linkage with L-BFGS (NLopt); every point where the gradient vanishes counts."""
    try:
        import nlopt  # type: ignore[import-untyped]
    except ImportError:
        raise Absent("nlopt is not installed (extra 'bench')") from None
    counted, visited, slopes = Counted(landscape, budget, price), [], []

    def function(u: Array, slope: Array) -> float:
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
    solver.set_upper_bounds(np.ones(dimension))
    solver.set_min_objective(function)
    with suppress(nlopt.ForcedStop, nlopt.runtime_error):  # the latter where the line search fails at the end
        solver.optimize(rng.random(dimension))
    points, sizes = np.array(visited).reshape(-1, dimension), np.array(slopes)
    return Answer(points[sizes < _FLAT * np.max(sizes, initial=0.0)], counted.spent)


def shgo(landscape: Landscape, dimension: int, budget: int, _: np.random.Generator, price: int) -> Answer:
    """Simplicial homology on Sobol points (SciPy): of 16, 32, ... points within the budget, those that find most."""
    answer, most = Answer(np.empty((0, dimension)), 0), 0
    points = 16
    while points < budget:
        counted = Counted(landscape, budget, price)
        with suppress(Spent):
            found = optimize.shgo(
                counted.value, [(0, 1)] * dimension, n=points, iters=1, sampling_method="sobol",
                options={"jac": counted.slope}, minimizer_kwargs={"method": "L-BFGS-B"},
            )  # fmt: skip
            distinct = len(np.unique(np.round(found.xl, 2), axis=0)) if found.success else 0
            if distinct > most:
                answer, most = Answer(np.atleast_2d(found.xl), counted.spent), distinct
        points *= 2
    return answer


def basin_hopping(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Answer:
    """Basin hopping (SciPy) with L-BFGS-B; every local end counts."""
    counted, ends = Counted(landscape, budget, price), []
    local = {"method": "L-BFGS-B", "jac": True, "bounds": [(0, 1)] * dimension}
    with suppress(Spent):
        optimize.basinhopping(
            counted.both, rng.random(dimension), niter=budget, stepsize=0.3, minimizer_kwargs=local, rng=rng,
            callback=lambda x, *_: ends.append(np.clip(x, 0, 1)),
        )  # fmt: skip
    return Answer(np.array(ends).reshape(-1, dimension), counted.spent)


def differential_evolution(
    landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int
) -> Answer:
    """Differential evolution (SciPy); its best point counts."""
    counted = Counted(landscape, budget)
    with suppress(Spent):
        optimize.differential_evolution(
            counted.value, [(0, 1)] * dimension, rng=rng, maxiter=budget, polish=False, tol=0
        )
    return Answer(counted.best[1].reshape(-1, dimension), counted.spent)


#: Of a population, those whose cost is within this share of its range above the best count as its optima.
_GOOD = 1e-3


def niche_ga(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """NicheGA (pymoo); its own list of optima counts."""
    algorithm = _pymoo("soo.nonconvex.ga_niching", "NicheGA")(pop_size=100)
    found, spent = _run_pymoo(algorithm, landscape, dimension, budget, rng)
    return Answer(np.atleast_2d(found.opt.get("X")), spent)


def omni(landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int) -> Answer:
    """Omni-optimizer (pymoo); the members of its last population that are about as good as the best count."""
    algorithm = _pymoo("moo.omni", "OmniOptimizer")(pop_size=100)
    found, spent = _run_pymoo(algorithm, landscape, dimension, budget, rng)
    cost, points = found.pop.get("F")[:, 0], found.pop.get("X")
    return Answer(points[cost <= cost.min() + _GOOD * max(float(np.ptp(cost)), 1e-12)], spent)


def _pymoo(module: str, name: str) -> Any:
    try:
        return getattr(import_module(f"pymoo.algorithms.{module}"), name)
    except (ImportError, AttributeError):
        raise Absent(f"pymoo with {name} is not installed (extra 'bench')") from None


def _run_pymoo(
    algorithm: Any, landscape: Landscape, dimension: int, budget: int, rng: np.random.Generator
) -> tuple[Any, int]:
    """The finished run and its number of evaluations."""
    base = import_module("pymoo.core.problem").Problem
    evaluate = {"_evaluate": lambda _, x, out, *__, **___: out.update(F=landscape.value(x))}
    task = type("Task", (base,), evaluate)(n_var=dimension, n_obj=1, xl=0.0, xu=1.0)
    minimise = import_module("pymoo.optimize").minimize
    found = minimise(task, algorithm, ("n_eval", budget), seed=int(rng.integers(2**31)))
    return found, int(found.algorithm.evaluator.n_eval)
