"""The front: points of which none is better than another at every test, in parallel coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from mofit.report.display import math_symbol, number
from mofit.report.page import Figure
from mofit.report.run import Array, Run, labels, numbers
from mofit.report.style import FLOOR, cluster_colour, image_of, legend_above, line_key, panels


@dataclass(frozen=True)
class Front:
    """Non-dominated points: NRMSD per objective, and their place in the search box (0 to 1)."""

    objectives: list[str]
    parameters: list[str]
    moved: list[int]
    nrmsd: Array
    place: Array
    noise_floor: Array
    minima_nrmsd: dict[str, Array]
    minima_place: dict[str, Array]


def extract_front(run: Run) -> Front | None:
    """The non-dominated points, or None where the run has none."""
    node = run.group("front")
    if node is None or node.sizes.get("point", 0) == 0:
        return None
    names, objectives = labels(node, "parameter"), labels(node, "objective")
    same = [c for c in run.clusters if c.parameters == names]
    floor = dict(zip(run.tests, run.of_tests("noise_floor"), strict=True))

    def of_objectives(values: Array) -> Array:
        known = dict(zip(run.tests, values, strict=True))
        return np.array([known.get(objective, np.nan) for objective in objectives])

    return Front(
        objectives=objectives,
        parameters=names,
        moved=run.moved(numbers(node, "parameters"), names),
        nrmsd=numbers(node, "nrmsd"),
        place=run.to_unit(numbers(node, "parameters"), names),
        noise_floor=np.array([floor.get(objective, np.nan) for objective in objectives]),
        minima_nrmsd={c.name: of_objectives(numbers(c.node, "nrmsd")) for c in same},
        minima_place={c.name: run.to_unit(c.array("value"), names) for c in same},
    )


def draw_front(values: Array, minima: dict[str, Array], labels: list[str], axes: Axes) -> Axes:
    """Parallel coordinates: a line per point, a thick line per solution."""
    x = np.arange(values.shape[1])
    shade = np.linspace(0.3, 0.95, len(values))
    lines = LineCollection([np.column_stack([x, row]) for row in values], cmap="Greys", lw=0.7, alpha=0.6)
    lines.set_array(shade)
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    for k, line in reversed([*enumerate(minima.values())]):
        axes.plot(x, line, color=cluster_colour(k), lw=2.2, marker="o", ms=4)
    crowded = len(labels) > 6
    axes.set_xticks(x, labels, rotation=40 if crowded else 0, ha="right" if crowded else "center")
    axes.set_xlim(-0.15, max(len(labels) - 0.85, 0.15))
    axes.grid(visible=True, axis="x")
    return axes


def front_figure(front: Front) -> Figure:
    """Errors at the tests on the left, parameters that moved on the right; dark lines are the better ones."""
    order = np.argsort(-front.nrmsd.mean(axis=1))
    moved, both = front.moved, len(front.moved) > 1
    canvas, axes, _ = panels(1 + both, 2, 2.5, margin=(0.65, 0.95, 0.15, 0.5), gap=(0.8, 0.0))
    minima = {name: 100 * value for name, value in front.minima_nrmsd.items()}
    left = draw_front(100 * front.nrmsd[order], minima, front.objectives, axes[0])
    left.plot(np.arange(len(front.objectives)), 100 * front.noise_floor, color=FLOOR, lw=2)
    left.set_ylabel("NRMSD (%)")
    left.set_ylim(0, 1.05 * 100 * float(np.nanmax(front.nrmsd)))
    if both:
        names = [math_symbol(front.parameters[k]) for k in moved]
        places = {name: place[moved] for name, place in front.minima_place.items()}
        right = draw_front(front.place[order][:, moved], places, names, axes[1])
        right.set_ylim(-0.02, 1.02)
        right.set_yticks([0, 0.5, 1], ["lower\nbound", "", "upper\nbound"])
    handles = [line_key(cluster_colour(k), f"solution {name}", marker="o", ms=4) for k, name in enumerate(minima)]
    legend_above(canvas, [*handles[:4], line_key("#999999", "front", lw=1), line_key(FLOOR, "noise floor", lw=2)])
    best = number(100 * float(front.nrmsd.mean(axis=1).min()))
    return Figure(
        image_of(canvas),
        "Parallel coordinates of the non-dominated points",
        f"{len(front.nrmsd)} points of which none is better than another at every test (smallest mean {best} %). "
        f"Left the error of "
        "each at each test, right its parameters inside the search box; dark is better.",
        good="the lines run close together: one set of parameters serves all tests.",
        bad="lines cross between tests on the left and spread on the right: each test wants other parameters, so "
        "the model "
        "lacks something that changes between them.",
    )
