"""The CEC 2013 niching benchmark, functions 1 to 10, with the official budgets, accuracies and count of optima.

Li, Engelbrecht and Epitropakis, "Benchmark functions for CEC'2013 special session and competition on niching methods
for multimodal function optimization", RMIT University 2013. Functions 11 to 20 are compositions whose rotation
matrices and optima come as data files with the official code; they are left out.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from benchmarks import peers
from benchmarks.cec2013_functions import FUNCTIONS, Niching, found_optima
from benchmarks.rows import KeptRows
from mofit._typing import FloatArray
from mofit.optimize.searches import mlsl
from studies.report_page import versions

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
