"""Equivalents of Figures 5 and 6 of Hackl et al. 2016, drawn from one run of the paper's algorithm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.cluster.hierarchy import dendrogram, linkage

from mofit.bench.rastrigin_function import HALF, Rastrigin
from mofit.search import PAPER, SearchResult, cluster, effa


def draw_figures(folder: Path, seed: int = 0) -> dict[str, str]:
    """Write both figures into a folder: file name to caption."""
    function = Rastrigin.plain()
    half_way = effa(function.value, 2, np.random.default_rng(seed), replace(PAPER, iterations=12))
    final = effa(function.value, 2, np.random.default_rng(seed), PAPER)
    _clustering(function, half_way).savefig(folder / "figure_5.png", dpi=110)
    _outcome(function, final).savefig(folder / "figure_6.png", dpi=110)
    return {
        "figure_5.png": "As Figure 5: dendrogram, cluster radius and its slope per number of clusters, and the swarm "
        "after 12 of 24 iterations.",
        "figure_6.png": "As Figure 6: the swarm at the end, and the stored cluster bests.",
    }


def _clustering(function: Rastrigin, result: SearchResult) -> Figure:
    points = function.scaled(result.fireflies)
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
        (left, result.fireflies, "swarm after 24 iterations"),
        (right, result.stored_points, "stored bests of clusters"),
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
