"""The search: every point evaluated, the bests it stored, and the solutions (Hackl et al. 2016, Figure 9)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mofit.report.display import count, math_symbol, number
from mofit.report.front import extract_front, front_figure
from mofit.report.growth import extract_growth, growth_figure
from mofit.report.page import Block, Figure, Section, Text
from mofit.report.run import Array, Run, labels, numbers
from mofit.report.style import (
    MEASURED,
    cluster_colour,
    few_ticks,
    image_of,
    legend_above,
    legend_height,
    line_key,
    panels,
)

_COLOURS = "viridis"


@dataclass(frozen=True)
class SearchMap:
    """Points of the search in SI units and their mean NRMSD over the tests, best last; minima of the clusters.

    `moved` says which parameters the search varied; the others were held at what an earlier stage had found.
    """

    parameters: list[str]
    moved: list[int]
    points: Array
    nrmsd: Array
    stored: Array
    fireflies: Array
    minima: dict[str, Array]


def extract_search(run: Run) -> SearchMap | None:
    """The search's history, or None where the run has none."""
    node = run.group("search")
    if node is None:
        return None
    names = labels(node, "parameter")
    nrmsd = numbers(node, "nrmsd").mean(axis=1)
    good = np.isfinite(nrmsd)
    order = np.flatnonzero(good)[np.argsort(-nrmsd[good], kind="stable")]
    empty = np.empty((0, len(names)))
    return SearchMap(
        parameters=names,
        moved=run.moved(numbers(node, "points"), names),
        points=numbers(node, "points")[order],
        nrmsd=nrmsd[order],
        stored=numbers(node, "stored") if "stored" in node.variables else empty,
        fireflies=numbers(node, "fireflies") if "fireflies" in node.data_vars else empty,
        minima={c.name: c.array("value") for c in run.clusters if c.parameters == names},
    )


def pairs(count: int) -> list[tuple[int, int]]:
    """Which two parameters share a panel: all pairs of up to four, else neighbours."""
    if count <= 4:
        return list(combinations(range(count), 2))
    return [(k, min(k + 1, count - 1)) if k + 1 < count else (k - 1, k) for k in range(0, count, 2)]


def draw_search(found: SearchMap, x: int, y: int | None, log: np.ndarray, axes: Axes) -> Axes:
    """The points over two parameters (over one parameter and the NRMSD if `y` is None), dark is good."""
    colour = np.argsort(np.argsort(found.nrmsd)) / max(1, found.nrmsd.size - 1)

    def ordinate(points: Array, nrmsd: Array) -> Array:
        return 100 * nrmsd if y is None else points[:, y]

    axes.scatter(
        found.points[:, x],
        ordinate(found.points, found.nrmsd),
        c=colour,
        cmap=_COLOURS,
        s=7,
        lw=0,
        alpha=0.75,
        rasterized=True,
    )
    if y is not None:
        axes.plot(
            found.fireflies[:, x],
            found.fireflies[:, y],
            ls="none",
            marker="^",
            ms=4,
            mfc="none",
            mec="#57606a",
            mew=0.8,
        )
        axes.plot(
            found.stored[:, x], found.stored[:, y], ls="none", marker="s", ms=5.5, mfc="none", mec=MEASURED, mew=1.0
        )
        for k, minimum in reversed([*enumerate(found.minima.values())]):
            axes.plot(
                minimum[x],
                minimum[y],
                ls="none",
                marker="*",
                ms=15,
                mfc=cluster_colour(k),
                mec="white",
                mew=0.9,
                zorder=5,
            )
    else:
        for k, minimum in enumerate(found.minima.values()):
            axes.axvline(minimum[x], color=cluster_colour(k), lw=2)
    axes.set_xlabel(math_symbol(found.parameters[x]))
    axes.set_ylabel("mean NRMSD (%)" if y is None else math_symbol(found.parameters[y]))
    if log[x]:
        axes.set_xscale("log")
    if y is None or log[y]:
        axes.set_yscale("log")
    axes.minorticks_off()
    few_ticks(axes, None if log[x] else 5, None if y is None or log[y] else 5)
    return axes


def search_section(run: Run) -> Section | None:
    """Maps of the search, and the front."""
    found, front = extract_search(run), extract_front(run)
    blocks: list[Block] = []
    if found is not None:
        attrs = run.tree["search"].attrs
        blocks.append(
            Text(
                f"The search ({attrs['method']}) evaluated {count(attrs['evaluations'])} points of the box and "
                f"stored "
                f"{len(found.stored)} of them as minima or bests of a cluster; distinct solutions after refinement: "
                f"{len(run.clusters)}.{_unseen(attrs)}"
            )
        )
        blocks.append(_map(run, found))
        progress = extract_growth(run)
        if progress is not None:
            blocks.append(growth_figure(progress))
    if front is not None and len(front.objectives) > 1:
        blocks.append(front_figure(front))
    if not blocks:
        return None
    return Section("search", "Search", blocks, {"search": found, "front": front})


def _unseen(attrs: Mapping[Any, Any]) -> str:
    """What the search says of minima it has not seen."""
    unseen = float(attrs.get("unseen", np.nan))
    if not np.isfinite(unseen):
        return ""
    return f" Minima of the mean over the tests that it expects not to have seen: {number(unseen, 2)}."


def _map(run: Run, found: SearchMap) -> Figure:
    log = run.is_log(found.parameters)
    moved = found.moved
    chosen: list[tuple[int, int | None]] = [(moved[i], moved[j]) for i, j in pairs(len(moved))] or [(moved[0], None)]
    handles = _handles(found)
    top = legend_height(len(handles))
    canvas, axes, _ = panels(len(chosen), 3, 2.7, margin=(0.75, 0.55, 0.15, top), gap=(0.85, 0.75))
    for (x, y), panel in zip(chosen, axes, strict=True):
        draw_search(found, x, y, log, panel)
        for axis, k in (("x", x), ("y", y)):
            if k is not None:
                name = found.parameters[k]
                unit = run.unit(name)
                getattr(panel, f"set_{axis}label")(math_symbol(name) + ("" if unit == "1" else f" ({unit})"))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "Evaluated points, stored bests and solutions over pairs of parameters",
        "Where the search looked and what it found, over the search box. Colour ranks the mean NRMSD over all tests.",
        good="the box is covered, dark points gather in a few tight places, each with a solution in it.",
        bad="dark points lie along a valley (the parameters on its axes trade against each other) or at the edge "
        "of the box.",
    )


def _handles(found: SearchMap) -> list[Line2D]:
    handles = [
        line_key(cluster_colour(k), f"solution {n}", ls="none", marker="*", ms=11) for k, n in enumerate(found.minima)
    ]
    handles.append(line_key("#440154", "evaluated: good", ls="none", marker="o", ms=4))
    handles.append(line_key("#c5d93a", "evaluated: poor", ls="none", marker="o", ms=4))
    if len(found.stored) and len(found.moved) > 1:
        handles.append(line_key(MEASURED, "stored best", ls="none", marker="s", mfc="none"))
    if len(found.fireflies) and len(found.moved) > 1:
        handles.append(line_key("#57606a", "final swarm", ls="none", marker="^", mfc="none", ms=5))
    return handles
