"""The paper's test function: its Table 2, mofit's searches and their peers, plain and shifted and rotated.

Figures 5 and 6 of Hackl et al. 2016 are drawn again from one run of the paper's algorithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.cluster.hierarchy import dendrogram, linkage
from scipy.stats import ortho_group

from benchmarks import peers
from benchmarks.rows import KeptRows
from mofit._typing import FloatArray
from mofit.optimize import SearchResult
from mofit.optimize.population_clusters import cluster
from mofit.optimize.searches import effa_2016
from mofit.runtime.parallel import end_with_parent
from studies.report_page import versions

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

    shift: FloatArray
    rotation: FloatArray

    @classmethod
    def plain(cls, dimension: int = 2) -> Rastrigin:
        """The function of Hackl et al. 2016: 5^d minima in the box."""
        return cls(np.zeros(dimension), np.eye(dimension))

    @classmethod
    def turned(cls, rng: np.random.Generator, dimension: int = 2) -> Rastrigin:
        """Shifted by up to half the domain and rotated at random, so that no lattice or axis helps."""
        rotation = ortho_group.rvs(dimension, random_state=rng)
        return cls(rng.uniform(-HALF / 2, HALF / 2, dimension), rotation)

    def _inner(self, u: FloatArray) -> FloatArray:
        return np.asarray((2 * HALF * u - HALF - self.shift) @ self.rotation.T)

    def value(self, u: FloatArray) -> FloatArray:
        """Shape (N, 1)."""
        z = self._inner(u)
        return np.asarray(np.sum(z**2 + 10 * (1 - np.cos(2 * np.pi * z)), axis=1, keepdims=True))

    def gradient(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Value (N, 1) and gradient (N, 1, d)."""
        z = self._inner(u)
        slope = (2 * z + 20 * np.pi * np.sin(2 * np.pi * z)) @ self.rotation * 2 * HALF
        return self.value(u), slope[:, None, :]

    def scaled(self, u: FloatArray) -> FloatArray:
        """Points of the unit cube in the units of the domain."""
        return 2 * HALF * u - HALF

    @cached_property
    def minima(self) -> FloatArray:
        """All minima inside the box in the units of the domain, the global one first."""
        dimension = len(self.shift)
        reach = int(np.ceil(2 * HALF * np.sqrt(dimension))) + 1
        line = _minima_on_a_line(reach)
        lattice = np.array(list(product(line, repeat=dimension)))
        lattice = lattice[np.argsort(np.sum(lattice**2, axis=1), kind="stable")]
        placed = lattice @ self.rotation + self.shift
        return np.asarray(placed[np.all(np.abs(placed) <= HALF, axis=1)])


def _minima_on_a_line(reach: int) -> FloatArray:
    """Minima of z^2 + 10 (1 - cos 2 pi z), by Newton's method from the integers."""
    z = np.arange(-reach, reach + 1, dtype=float)
    for _ in range(50):
        z -= (2 * z + 20 * np.pi * np.sin(2 * np.pi * z)) / (2 + 40 * np.pi**2 * np.cos(2 * np.pi * z))
    return z


def found(answers: FloatArray, minima: FloatArray, tolerance: float) -> int:
    """How many minima have an answer within the tolerance."""
    if len(answers) == 0:
        return 0
    gaps = np.linalg.norm(answers[:, None] - minima[None], axis=-1)
    return int(np.sum(gaps.min(axis=0) <= tolerance))


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
    Entry("effa-2016", peers.paper, times=4),  # its shares are compared with those of 4,000 runs
    Entry("effa", peers.by_effa, 700, gradients=True),
    Entry("effa, its swarm", peers.by_swarm, 700, gradients=True),
    Entry("mlsl", peers.by_mlsl, gradients=True),
    Entry("surrogate", peers.by_surrogate, 300, runs=200),
    Entry("multi-start", peers.multi_start, gradients=True),
    Entry("MLSL (NLopt)", peers.mlsl, gradients=True),
    Entry("shgo", peers.shgo, gradients=True, runs=200),
    Entry("basin hopping", peers.basin_hopping, gradients=True),
    Entry("diff. evolution", peers.differential_evolution, runs=200),
)


def run(
    runs: int = 1000, seed: int = 0, jobs: int = 1, entries: Sequence[Entry] = ENTRIES
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All competitors on both functions.

    Parameters
    ----------
    runs
        Of each competitor; the paper's algorithm does four times as many, the slow ones at most 200.
    seed
        Of all runs; every run has its own stream, so that results do not depend on ``jobs``.
    jobs
        Processes.
    entries
        The competitors.

    Returns
    -------
    rows
        One per competitor, function and price of a gradient.
    settings
        What they were run with.
    """
    rows = KeptRows("rastrigin", {"runs": runs, "seed": seed, "entries": [entry.name for entry in entries]})
    with ProcessPoolExecutor(jobs, get_context("spawn"), end_with_parent) as pool:
        for turned in (False, True):
            for entry in entries:
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
    "effa": "700 evaluations; its swarm: the minima that descents from the centres of the swarm's clusters found",
    "price": "evaluations that a value with its gradient counts",
}


def _all(pool: ProcessPoolExecutor, entry: Entry, turned: bool, price: int, seed: int, runs: int) -> dict[str, Any]:
    """Statistics of all runs of one competitor."""
    return _row(turned, list(pool.map(partial(_single, entry, turned, price, seed), range(runs), chunksize=8)))


def _function(turned: bool) -> str:
    return "turned" if turned else "plain"


def _published(name: str, numbers: tuple[float, ...], runs: int) -> dict[str, Any]:
    return {
        "search": name, "function": _function(False), "runs": runs, "price": None, "spent": 600,
        "global %": numbers[0], **{f"{label} %": share for label, share in zip(BINS, numbers[1:], strict=True)},
    }  # fmt: skip


def _single(entry: Entry, turned: bool, price: int, seed: int, number: int) -> tuple[FloatArray, int]:
    """Global and number found, loosely and strictly, of how many; and what was spent."""
    rng = np.random.default_rng([seed, number, turned])
    function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
    answer = entry.search(function, 2, entry.budget, rng, price)
    points, minima = function.scaled(answer.points), function.minima
    counts = [found(points, minima[:k], tolerance) for tolerance in (LOOSE, STRICT) for k in (1, None)]
    return np.array([*counts, len(minima)]), answer.spent


def _row(turned: bool, results: list[tuple[FloatArray, int]]) -> dict[str, Any]:
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


def _bins(counts: FloatArray) -> list[float]:
    inner = [100 * float(np.mean(counts == k)) for k in (9, 8, 7, 6)]
    return [100 * float(np.mean(counts >= 10)), *inner, 100 * float(np.mean(counts <= 5))]


def draw_figures(folder: Path, seed: int = 0) -> dict[str, str]:
    """Write both figures into a folder: file name to caption."""
    function = Rastrigin.plain()
    searched = function.value, function.gradient, 2
    half_way = effa_2016.search(*searched, np.random.default_rng(seed), effa_2016.EffaSettings(iterations=12))
    final = effa_2016.search(*searched, np.random.default_rng(seed))
    _clustering(function, half_way).savefig(folder / "figure_5.png", dpi=110)
    _outcome(function, final).savefig(folder / "figure_6.png", dpi=110)
    return {
        "figure_5.png": "As Figure 5: dendrogram, cluster radius and its slope per number of clusters, and the swarm "
        "after 12 of 24 iterations.",
        "figure_6.png": "As Figure 6: the swarm at the end, and the stored cluster bests.",
    }


def _clustering(function: Rastrigin, result: SearchResult) -> Figure:
    points = function.scaled(result.population_points)
    found = cluster(points)
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    tree, radius, map_ = figure.subplots(1, 3)
    dendrogram(linkage(points, "complete"), p=found.count, truncate_mode="lastp", ax=tree, color_threshold=0)
    tree.set(title=f"dendrogram up to {found.count} clusters", ylabel="diameter", xlabel="fireflies in cluster")
    numbers = np.arange(1, len(points) + 1)
    slope = found.radii[:-1] - found.radii[1:]
    radius.plot(numbers, found.radii, "o-", ms=3, color="#0072B2", label="mean radius")
    radius.plot(numbers[:-1], slope, "s-", ms=3, color="#D55E00", label="slope")
    radius.axhline(found.radii[0] / (len(points) - 1), color="#1d2329", ls="--", lw=1, label="average slope")
    radius.axvline(found.count, color="#8c959f", lw=1)
    radius.set(title=f"{found.count} clusters chosen", xlabel="number of clusters", ylabel="radius")
    radius.legend(frameon=False)
    _ground(function, map_)
    colours = [f"C{k % 10}" for k in found.labels]
    map_.scatter(*points.T, c=colours, s=28, edgecolors="white", linewidths=0.6)
    map_.set_title("swarm after 12 iterations")
    return figure


def _outcome(function: Rastrigin, result: SearchResult) -> Figure:
    figure = Figure(figsize=(8, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, points, title in (
        (left, result.population_points, "swarm after 24 iterations"),
        (right, result.archived_points, "stored bests of clusters"),
    ):
        _ground(function, axes)
        axes.plot(*function.minima.T, "+", color="#1d2329", ms=7)
        axes.plot(*function.scaled(points).T, "o", color="#D55E00", mec="white", ms=6)
        axes.set_title(title)
    return figure


def _ground(function: Rastrigin, axes: Axes) -> None:
    line = np.linspace(0, 1, 161)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    height = function.value(grid).reshape(161, 161)
    extent = (-HALF, HALF, -HALF, HALF)
    axes.imshow(height, origin="lower", extent=extent, cmap="Greys", alpha=0.5, interpolation="bilinear")
    axes.set(xlabel="$x_1$", ylabel="$x_2$", xlim=(-2.05, 2.05), ylim=(-2.05, 2.05))
