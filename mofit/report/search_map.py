"""The search over pairs of parameters (Hackl et al. 2016, Figure 9): points, minima, modes, and the swarm's flight."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mofit._typing import FloatArray
from mofit.report.points import Points, extract_fireflies
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import BASELINE, MEASURED, MODE_COLOURS, Panels, dot_key, mode_colour
from mofit.report.toolkit.formatting import parameter_label, percent, whole_percent

#: Pairs of parameters, and generations (the first, one half way, the last), that are shown of the swarm.
_SHOWN = 3
_NAMED = "a firefly to choose"
#: Clusters with a colour of their own.
_COLOURED = 7


@dataclass(frozen=True)
class SearchMap:
    """Points of the search in SI units and their mean NRMSD over the tests, best last; MAP estimate of each mode.

    `moved` names the parameters that the search varied; the others were fixed at the estimate of an earlier stage.
    """

    parameters: list[str]
    units: list[str]
    log: list[bool]
    moved: list[int]
    points: FloatArray
    nrmsd: FloatArray
    archived: FloatArray
    modes: dict[str, FloatArray]


@dataclass(frozen=True)
class Swarm:
    """The fireflies in SI units, shape (generation, firefly, parameter), with their clusters, the best one 0."""

    search: SearchMap
    fireflies: FloatArray
    cluster: FloatArray
    single: FloatArray
    """Minima of single tests, shape (minimum, parameter)."""
    named: Points | None
    """Fireflies of the last generation whose signals the page can show."""


def extract_search(run: Run) -> SearchMap | None:
    """The search's history, or None where the run has none."""
    node = run.group("search")
    if node is None:
        return None
    names = labels(node, "parameter")
    space = run.space(names)
    points, nrmsd = numbers(node, "points"), numbers(node, "nrmsd").mean(axis=1)
    good = np.isfinite(nrmsd)
    order = np.flatnonzero(good)[np.argsort(-nrmsd[good], kind="stable")]
    empty = np.empty((0, len(names)))
    return SearchMap(
        parameters=names,
        units=list(space.units),
        log=[parameter.scale == "log" for parameter in space.parameters],
        moved=moved(space.to_unit(points)),
        points=points[order],
        nrmsd=nrmsd[order],
        archived=numbers(node, "archived") if "archived" in node.data_vars else empty,
        modes={mode.name: mode.array("value") for mode in run.modes if mode.parameters == names},
    )


def extract_swarm(run: Run) -> Swarm | None:
    """The swarm's flight, or None where the search had no swarm."""
    node, found = run.group("search"), extract_search(run)
    if node is None or found is None or "generations" not in node.data_vars:
        return None
    of_one_test = np.array([str(test) for test in node["minimises"].to_numpy()]) != ""
    return Swarm(
        found,
        numbers(node, "generations"),
        numbers(node, "cluster"),
        found.archived[of_one_test],
        extract_fireflies(run),
    )


def moved(places: FloatArray) -> list[int]:
    """Which parameters differ between points (n, d) of the prior box by over a thousandth of it (all if none does)."""
    d = places.shape[1]
    width = np.ptp(places, axis=0) if len(places) else np.zeros(d)
    return [k for k in range(d) if width[k] > 1e-3] or [*range(d)]


def pairs(count: int) -> list[tuple[int, int]]:
    """Which two parameters share a panel: all pairs of up to four, else neighbours."""
    if count <= 4:
        return list(combinations(range(count), 2))
    return [(k, min(k + 1, count - 1)) if k + 1 < count else (k - 1, k) for k in range(0, count, 2)]


def draw_search(found: SearchMap, x: int, y: int | None, axes: Axes) -> Axes:
    """The points over two parameters (over one parameter and the NRMSD if `y` is None), dark is good."""
    rank = np.argsort(np.argsort(found.nrmsd)) / max(1, found.nrmsd.size - 1)
    ordinate = 100 * found.nrmsd if y is None else found.points[:, y]
    dots: dict[str, Any] = {"s": 7, "lw": 0, "alpha": 0.75, "rasterized": True}
    axes.scatter(found.points[:, x], ordinate, c=rank, cmap="viridis", **dots)
    hollow: dict[str, Any] = {"ls": "none", "mfc": "none"}
    if y is not None:
        axes.plot(*found.archived[:, [x, y]].T, marker="s", ms=5.5, mec=MEASURED, mew=1.0, **hollow)
    for k, value in reversed([*enumerate(found.modes.values())]):
        if y is None:
            axes.axvline(value[x], color=mode_colour(k), lw=2)
        else:
            _star(value[[x, y]], k, axes)
    axes.set_ylabel("mean NRMSD (%)")
    return _scaled(found, x, y, axes)


def _star(place: FloatArray, mode: int, axes: Axes) -> None:
    style: dict[str, Any] = {"marker": "*", "ms": 15, "mec": "white", "mew": 0.9, "zorder": 5}
    axes.plot(*place, ls="none", mfc=mode_colour(mode), **style)


def _scaled(found: SearchMap, x: int, y: int | None, axes: Axes) -> Axes:
    """Labels and scales of the parameters; a logarithmic ordinate where it is no parameter."""
    axes.set_xlabel(parameter_label(found.parameters[x], found.units[x]))
    if y is not None:
        axes.set_ylabel(parameter_label(found.parameters[y], found.units[y]))
    log = found.log[x], y is None or found.log[y]
    axes.set(xscale="log" if log[0] else "linear", yscale="log" if log[1] else "linear")
    axes.minorticks_off()
    few_ticks(axes, None if log[0] else 5, None if log[1] else 5)
    return axes


def map_figure(found: SearchMap) -> Figure:
    """All evaluated points, with what the search found and the modes."""
    free = found.moved
    chosen: list[tuple[int, int | None]] = [(free[i], free[j]) for i, j in pairs(len(free))] or [(free[0], None)]
    panels = Panels(len(chosen), 3, 2.7, legend=_legend(found), margin=(0.75, 0.55, 0.15), gap=(0.85, 0.75))
    for (x, y), axes in zip(chosen, panels.axes, strict=True):
        draw_search(found, x, y, axes)
    return panels.figure(
        "Evaluated points, archived minima and modes over pairs of parameters",
        "Where the search evaluated the model and what it found, over the prior box. The colour ranks the mean NRMSD "
        "over all tests.",
        good="points cover the box, dark points gather in a few tight places, each with a mode in it.",
        bad="dark points lie along a valley (the two parameters are correlated) or at the edge of the box.",
        finding=f"{len(found.nrmsd)} points were evaluated; the best has a mean NRMSD of {percent(found.nrmsd.min())}, "
        f"the median {percent(float(np.median(found.nrmsd)))}.",
    )


def _legend(found: SearchMap) -> list[Line2D]:
    legend = [dot_key(mode_colour(k), f"mode {name}", marker="*", size=11) for k, name in enumerate(found.modes)]
    legend += [dot_key("#440154", "evaluated: good", size=4), dot_key("#c5d93a", "evaluated: poor", size=4)]
    if len(found.archived) and len(found.moved) > 1:
        legend.append(dot_key(MEASURED, "minimum found by the search", hollow=True, marker="s"))
    return legend


def swarm_figure(swarm: Swarm) -> Figure:
    """A row per pair of parameters, a column per generation."""
    found = swarm.search
    chosen = [(found.moved[i], found.moved[j]) for i, j in pairs(len(found.moved))][:_SHOWN]
    last = len(swarm.fireflies) - 1
    shown = [0, last // 2, last] if last > 1 else [*range(last + 1)]
    counted = f"one of the {_COLOURED} best clusters"
    legend = [dot_key(mode_colour(1), counted), dot_key(BASELINE, "another cluster", size=4)]
    legend += [dot_key(MEASURED, "minimum of a single test", hollow=True, marker="s")]
    legend += [dot_key(mode_colour(k), f"mode {name}", marker="*", size=11) for k, name in enumerate(found.modes)][:3]
    if swarm.named is not None:
        legend.append(dot_key(swarm.named.colour, _NAMED, hollow=True, size=8))
    panels = Panels(
        len(shown) * len(chosen), len(shown), 2.3, legend=legend, margin=(0.75, 0.55, 0.15), gap=(0.85, 0.75)
    )
    for k, axes in enumerate(panels.axes):
        (x, y), generation = chosen[k // len(shown)], shown[k % len(shown)]
        _draw_swarm(swarm, x, y, generation, axes)
        if generation == last and swarm.named is not None:
            _draw_named(swarm.named, x, y, axes)
        if k < len(shown):
            axes.set_title(f"generation {generation}")
        if generation != shown[0]:  # the ordinate is the first one's, as long as they stand abreast
            axes.yaxis.label.set_visible(False)
            axes.tick_params(axis="y", labelleft=False)
    clusters = int(swarm.cluster.max(initial=-1)) + 1
    return panels.figure(
        "Fireflies of three generations over pairs of parameters, coloured by cluster",
        f"The swarm: {swarm.fireflies.shape[1]} fireflies over {last + 1} generations. All points that it evaluated "
        f"form {clusters} clusters by their mean error; a gradient descent starts from the centre of each."
        + (" A click on a ring of the last generation shows the signals at that firefly." if swarm.named else ""),
        good="fireflies of one colour gather around a mode, or along the way between the minima of single tests.",
        bad="squares lie far apart: the tests prefer different parameters, so the model lacks something.",
        finding=_gathered(swarm),
    )


def _gathered(swarm: Swarm) -> str:
    """How much narrower the swarm's middle half is in the end, over all parameters that moved."""
    log = np.array(swarm.search.log)
    places = np.where(log, np.log(np.where(log, swarm.fireflies, 1.0)), swarm.fireflies)[..., swarm.search.moved]
    first, last = (np.ptp(np.nanquantile(places[k], [0.25, 0.75], axis=0), axis=0) for k in (0, -1))
    ratio = float(np.median(last / np.maximum(first, np.finfo(float).tiny)))
    return (
        f"From the first to the last generation the middle half of the fireflies came to {whole_percent(ratio)} of its "
        "width (median over the parameters)."
    )


def _draw_named(named: Points, x: int, y: int, axes: Axes) -> None:
    """Rings around the fireflies that lead to their signals."""
    ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 8, "mfc": "none", "mew": 1.4, "label": _NAMED}
    (rings,) = axes.plot(*named.values[:, [x, y]].T, mec=named.colour, **ring)
    keyed(rings, firefly=named.names)


def _draw_swarm(swarm: Swarm, x: int, y: int, generation: int, axes: Axes) -> None:
    found, here, cluster = swarm.search, swarm.fireflies[generation], swarm.cluster[generation]
    for k in range(_COLOURED + 1):
        own = cluster == k if k < _COLOURED else ~np.isin(cluster, range(_COLOURED))
        colour = MODE_COLOURS[k] if k < _COLOURED else BASELINE
        axes.plot(*here[own][:, [x, y]].T, ls="none", marker="o", ms=4, mfc=colour, mec="white", mew=0.4)
    axes.plot(*swarm.single[:, [x, y]].T, ls="none", marker="s", ms=5.5, mfc="none", mec=MEASURED, mew=1.0)
    for k, value in reversed([*enumerate(found.modes.values())]):
        _star(value[[x, y]], k, axes)
    _scaled(found, x, y, axes)
    values = np.concatenate([swarm.fireflies.reshape(-1, here.shape[-1]), swarm.single])
    for axis, index in (("x", x), ("y", y)):  # the same section in every generation
        low, high = np.nanmin(values[:, index]), np.nanmax(values[:, index])
        room = (high / low) ** 0.04 if found.log[index] else 0.04 * (high - low)
        limits = (low / room, high * room) if found.log[index] else (low - room, high + room)
        axes.set(**{f"{axis}lim": limits})
