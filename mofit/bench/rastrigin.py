"""The paper's test function: its Table 2, mofit's searches and their peers, plain and shifted and rotated."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from mofit.bench import peers
from mofit.bench.competitors import Absent
from mofit.bench.rastrigin_function import Rastrigin, found
from mofit.bench.rows import Rows
from mofit.bench.versions import versions
from mofit.parameters import Array

#: Table 2 of Hackl et al. 2016: % of 100 runs with the global minimum, and with >= 10, 9, 8, 7, 6, <= 5 minima.
PUBLISHED = (82.0, 4.0, 13.0, 21.0, 38.0, 17.0, 7.0)
#: The same of an independent prototype of the algorithm, 4,000 runs.
PROTOTYPE = (81.2, 3.9, 12.6, 24.8, 32.4, 19.4, 6.9)
BINS = (">=10", "9", "8", "7", "6", "<=5")
#: A minimum counts within this distance: the paper's, and a strict one.
LOOSE, STRICT = 0.3, 0.05


@dataclass(frozen=True)
class Entry:
    """A competitor: its budget, whether it takes gradients, how many times the runs asked for, and the most runs."""

    name: str
    search: peers.Search
    budget: int = 600
    gradients: bool = False
    times: int = 1
    runs: int = 10_000


ENTRIES = (
    Entry("paper", peers.paper, times=4),  # its shares are compared with those of 4,000 runs
    Entry("niching", peers.by_niching, gradients=True),
    Entry("surrogate", peers.by_surrogate, 300, runs=200),
    Entry("multi-start", peers.multi_start, gradients=True),
    Entry("MLSL", peers.mlsl, gradients=True),
    Entry("shgo", peers.shgo, gradients=True, runs=200),
    Entry("basin hopping", peers.basin_hopping, gradients=True),
    Entry("diff. evolution", peers.differential_evolution, runs=200),
)


def run(runs: int = 1000, seed: int = 0, jobs: int = 1) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All competitors on both functions.

    Parameters
    ----------
    runs
        Of each competitor; the paper's algorithm does four times as many, the slow ones at most 200.
    seed
        Of all runs; every run has its own stream, so that results do not depend on ``jobs``.
    jobs
        Processes.

    Returns
    -------
    rows
        One per competitor, function and price of a gradient.
    settings
        What they were run with.
    """
    rows = Rows("rastrigin", {"runs": runs, "seed": seed})
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for turned in (False, True):
            for entry in ENTRIES:
                for price in (1, 3) if entry.gradients else (1,):
                    count = min(entry.times * runs, entry.runs)
                    head = {"search": entry.name, "function": _function(turned), "runs": count, "price": price}
                    rows.add(head, partial(_all, pool, entry, turned, price, seed, count))
    published = [_published("Table 2", PUBLISHED, 100), _published("prototype", PROTOTYPE, 4000)]
    return [*published, *rows.done()], {
        "runs": runs,
        "seed": seed,
        **versions("numpy", "scipy"),
        **NOTES,
    }


NOTES = {
    "function": "Rastrigin on [-2, 2]^2; turned: shifted by up to 1 and rotated at random in every run",
    "Table 2": "Hackl et al. 2016; prototype: an independent one of the paper's algorithm",
    "peers": "L-BFGS-B from Sobol points (multi-start), MLSL with L-BFGS (NLopt), the others SciPy",
    "%": f"of runs with the global, and with 10 or more, 9, ... minima, to within {LOOSE} as in the paper",
    "found": f"minima with a reported point within {STRICT}; strict %: global so; all %: of runs with all found",
    "price": "evaluations that a value with its gradient counts",
}


def _all(pool: ProcessPoolExecutor, entry: Entry, turned: bool, price: int, seed: int, runs: int) -> dict[str, Any]:
    """What all runs of one competitor come to."""
    try:
        return _row(turned, list(pool.map(partial(_single, entry, turned, price, seed), range(runs), chunksize=8)))
    except Absent as reason:
        return {"skipped": str(reason)}


def _function(turned: bool) -> str:
    return "turned" if turned else "plain"


def _published(name: str, numbers: tuple[float, ...], runs: int) -> dict[str, Any]:
    return {
        "search": name, "function": _function(False), "runs": runs, "price": None, "spent": 600,
        "global %": numbers[0], **{f"{label} %": share for label, share in zip(BINS, numbers[1:], strict=True)},
    }  # fmt: skip


def _single(entry: Entry, turned: bool, price: int, seed: int, number: int) -> tuple[Array, int]:
    """Global and number found, loosely and strictly, of how many; and what was spent."""
    rng = np.random.default_rng([seed, number, turned])
    function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
    answer = entry.search(function, 2, entry.budget, rng, price)
    points, minima = function.scaled(answer.points), function.minima
    counts = [found(points, minima[:k], tolerance) for tolerance in (LOOSE, STRICT) for k in (1, None)]
    return np.array([*counts, len(minima)]), answer.spent


def _row(turned: bool, results: list[tuple[Array, int]]) -> dict[str, Any]:
    counts = np.array([result for result, _ in results], dtype=float)
    loosely_global, loosely, strictly_global, strictly, inside = counts.T
    row = {"spent": float(np.mean([spent for _, spent in results])), "global %": 100 * float(loosely_global.mean())}
    if not turned:
        row |= {f"{label} %": share for label, share in zip(BINS, _bins(loosely), strict=True)}
    return row | {
        "strict %": 100 * float(strictly_global.mean()),
        "found": float(strictly.mean()),
        "of": float(inside.mean()),
        "share %": 100 * float(strictly.sum() / inside.sum()),
        "all %": 100 * float(np.mean(strictly == inside)),
    }


def _bins(counts: Array) -> list[float]:
    inner = [100 * float(np.mean(counts == k)) for k in (9, 8, 7, 6)]
    return [100 * float(np.mean(counts >= 10)), *inner, 100 * float(np.mean(counts <= 5))]
