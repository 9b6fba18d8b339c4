"""The search: points, archived minima, modes (Hackl et al. 2016, Figure 9), its convergence, its Pareto front."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Figure, Section, Text
from mofit.report.toolkit.figures import FLOOR, MEASURED, SOFT, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import count, math_symbol, number, parameter_label


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
    population: FloatArray
    modes: dict[str, FloatArray]


@dataclass(frozen=True)
class Growth:
    """Evaluations, and least mean NRMSD and hypervolume after them."""

    evaluations: FloatArray
    best: FloatArray
    hypervolume: FloatArray


@dataclass(frozen=True)
class Front:
    """Non-dominated points: NRMSD per objective, and their place in the prior box (0 to 1)."""

    objectives: list[str]
    parameters: list[str]
    moved: list[int]
    nrmsd: FloatArray
    place: FloatArray
    noise_floor: FloatArray
    mode_nrmsd: dict[str, FloatArray]
    mode_place: dict[str, FloatArray]


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
        moved=_moved(space.to_unit(points)),
        points=points[order],
        nrmsd=nrmsd[order],
        archived=numbers(node, "archived") if "archived" in node.data_vars else empty,
        population=numbers(node, "population") if "population" in node.data_vars else empty,
        modes={mode.name: mode.array("value") for mode in run.modes if mode.parameters == names},
    )


def _extract_growth(run: Run) -> Growth | None:
    """How the search converged, or None where the run has no record of it."""
    node = run.group("search")
    if node is None or "hypervolume" not in node.data_vars:
        return None
    return Growth(numbers(node, "checkpoint"), numbers(node, "best"), numbers(node, "hypervolume"))


def extract_front(run: Run) -> Front | None:
    """The non-dominated points, or None where the run has none."""
    node = run.group("front")
    if node is None or node.sizes.get("point", 0) == 0:
        return None
    names, objectives = labels(node, "parameter"), labels(node, "objective")
    same = [mode for mode in run.modes if mode.parameters == names]
    space = run.space(names)
    place = space.to_unit(numbers(node, "parameters"))

    def of_objectives(values: FloatArray) -> FloatArray:
        known = dict(zip(run.tests, values, strict=True))
        return np.array([known.get(objective, np.nan) for objective in objectives])

    return Front(
        objectives=objectives,
        parameters=names,
        moved=_moved(place),
        nrmsd=numbers(node, "nrmsd"),
        place=place,
        noise_floor=of_objectives(run.of_tests("noise_floor")),
        mode_nrmsd={mode.name: of_objectives(numbers(mode.node, "nrmsd")) for mode in same},
        mode_place={mode.name: space.to_unit(mode.array("value")) for mode in same},
    )


def _moved(places: FloatArray) -> list[int]:
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
        axes.plot(*found.population[:, [x, y]].T, marker="^", ms=4, mec=SOFT, mew=0.8, **hollow)
        axes.plot(*found.archived[:, [x, y]].T, marker="s", ms=5.5, mec=MEASURED, mew=1.0, **hollow)
    for k, value in reversed([*enumerate(found.modes.values())]):
        if y is None:
            axes.axvline(value[x], color=mode_colour(k), lw=2)
        else:
            star: dict[str, Any] = {"marker": "*", "ms": 15, "mec": "white", "mew": 0.9, "zorder": 5}
            axes.plot(value[x], value[y], ls="none", mfc=mode_colour(k), **star)
    axes.set_xlabel(parameter_label(found.parameters[x], found.units[x]))
    axes.set_ylabel("mean NRMSD (%)" if y is None else parameter_label(found.parameters[y], found.units[y]))
    log = found.log[x], y is None or found.log[y]
    axes.set(xscale="log" if log[0] else "linear", yscale="log" if log[1] else "linear")
    axes.minorticks_off()
    few_ticks(axes, None if log[0] else 5, None if log[1] else 5)
    return axes


def search_section(run: Run) -> Section | None:
    """Maps of the search, its convergence, and the front."""
    found, growth, front = extract_search(run), _extract_growth(run), extract_front(run)
    blocks: list[Block] = []
    if found is not None:
        blocks += [Text(_summary(run, found)), _map(found)]
    if growth is not None:
        blocks.append(_growth_figure(growth))
    if front is not None and len(front.objectives) > 1:
        blocks.append(_front_figure(front))
    return Section("search", "Search", blocks, {"search": found, "front": front}) if blocks else None


def _summary(run: Run, found: SearchMap) -> str:
    attrs = run.tree["search"].attrs
    text = (
        f"The search ({attrs['method']}) evaluated {count(attrs['evaluations'])} points of the prior box and archived "
        f"{len(found.archived)} of them as minima or best points of clusters. Refinement led to {len(run.modes)} "
        f"distinct mode{'' if len(run.modes) == 1 else 's'}."
    )
    undiscovered = float(attrs.get("expected_undiscovered_minima", np.nan))
    if not np.isfinite(undiscovered):
        return text
    return f"{text} Expected undiscovered minima of the mean over the tests: {number(undiscovered, 2)}."


def _map(found: SearchMap) -> Figure:
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
    )


def _legend(found: SearchMap) -> list[Line2D]:
    legend = [dot_key(mode_colour(k), f"mode {name}", marker="*", size=11) for k, name in enumerate(found.modes)]
    legend += [dot_key("#440154", "evaluated: good", size=4), dot_key("#c5d93a", "evaluated: poor", size=4)]
    if len(found.archived) and len(found.moved) > 1:
        legend.append(dot_key(MEASURED, "archived minimum", hollow=True, marker="s"))
    if len(found.population) and len(found.moved) > 1:
        legend.append(dot_key(SOFT, "final population", hollow=True, marker="^"))
    return legend


def _growth_figure(growth: Growth) -> Figure:
    """Two curves over the number of evaluations."""
    panels = Panels(2, 3, 1.8, gap=(0.85, 0.0), top=0.2)
    curves = {"least mean NRMSD (%)": 100 * growth.best, "hypervolume": growth.hypervolume}
    for axes, (label, values) in zip(panels.axes, curves.items(), strict=True):
        axes.plot(growth.evaluations, values, color=MEASURED, marker="o", ms=3.5)
        axes.set_ylabel(label)
        few_ticks(axes)
    panels.label("evaluations")
    panels.axes[1].set_ylim(0, 1.02)
    return panels.figure(
        "Best point and hypervolume of the front over the evaluations of the search",
        "Left: the best point so far. Right: the hypervolume, which is the share of the box from best to median of "
        "every objective that the front dominates. It grows as long as the front improves.",
        good="both curves are flat at the end: more evaluations would find nothing new.",
        bad="a curve still moves at the end: give the search a larger budget.",
    )


def _draw_front(values: FloatArray, modes: dict[str, FloatArray], names: list[str], axes: Axes) -> Axes:
    """Parallel coordinates: a line per point, a thick line per mode."""
    x = np.arange(values.shape[1])
    lines = LineCollection([np.column_stack([x, row]) for row in values], cmap="Greys", lw=0.7, alpha=0.6)
    lines.set_array(np.linspace(0.3, 0.95, len(values)))
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    for k, line in reversed([*enumerate(modes.values())]):
        axes.plot(x, line, color=mode_colour(k), lw=2.2, marker="o", ms=4)
    crowded = len(names) > 6
    axes.set_xticks(x, names, rotation=40 if crowded else 0, ha="right" if crowded else "center")
    axes.set_xlim(-0.15, max(len(names) - 0.85, 0.15))
    axes.grid(visible=True, axis="x")
    return axes


def _front_figure(front: Front) -> Figure:
    """Errors at the tests on the left, parameters that moved on the right; dark lines are the better ones."""
    order = np.argsort(-front.nrmsd.mean(axis=1))
    both = len(front.moved) > 1
    legend = [line_key(mode_colour(k), f"mode {name}", marker="o", ms=4) for k, name in enumerate(front.mode_nrmsd)]
    legend = [*legend[:4], line_key("#999999", "front", lw=1), line_key(FLOOR, "noise floor", lw=2)]
    panels = Panels(1 + both, 2, 2.5, legend=legend, margin=(0.65, 0.95, 0.15), gap=(0.8, 0.0))
    errors = {name: 100 * value for name, value in front.mode_nrmsd.items()}
    left = _draw_front(100 * front.nrmsd[order], errors, front.objectives, panels.axes[0])
    left.plot(np.arange(len(front.objectives)), 100 * front.noise_floor, color=FLOOR, lw=2)
    left.set_ylabel("NRMSD (%)")
    left.set_ylim(0, 1.05 * 100 * float(np.nanmax(front.nrmsd)))
    if both:
        names = [math_symbol(front.parameters[k]) for k in front.moved]
        places = {name: place[front.moved] for name, place in front.mode_place.items()}
        right = _draw_front(front.place[order][:, front.moved], places, names, panels.axes[1])
        right.set_ylim(-0.02, 1.02)
        right.set_yticks([0, 0.5, 1], ["lower\nbound", "", "upper\nbound"])
    best = number(100 * float(front.nrmsd.mean(axis=1).min()))
    return panels.figure(
        "Parallel coordinates of the non-dominated points",
        f"Pareto front: {len(front.nrmsd)} points, none of them better than another at every test. The smallest mean "
        f"NRMSD is {best} %. Left: the error of each point at each test. Right: its parameters within the prior box. "
        "Dark is better.",
        good="the lines run close together: one set of parameters serves all tests.",
        bad="lines cross between tests on the left and diverge on the right: each test prefers other parameters; the "
        "model lacks something that changes between them.",
    )
