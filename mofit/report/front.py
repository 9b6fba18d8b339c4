"""The Pareto front of the search over the tests, in parallel coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.figures import FLOOR, Panels, line_key, mode_colour
from mofit.report.toolkit.formatting import math_symbol, number


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


def moved(places: FloatArray) -> list[int]:
    """Which parameters differ between points (n, d) of the prior box by over a thousandth of it (all if none does)."""
    d = places.shape[1]
    width = np.ptp(places, axis=0) if len(places) else np.zeros(d)
    return [k for k in range(d) if width[k] > 1e-3] or [*range(d)]


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
        moved=moved(place),
        nrmsd=numbers(node, "nrmsd"),
        place=place,
        noise_floor=of_objectives(run.of_tests("noise_floor")),
        mode_nrmsd={mode.name: of_objectives(numbers(mode.node, "nrmsd")) for mode in same},
        mode_place={mode.name: space.to_unit(mode.array("value")) for mode in same},
    )


def draw_front(values: FloatArray, modes: dict[str, FloatArray], names: list[str], axes: Axes) -> Axes:
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


def front_figure(front: Front) -> Figure:
    """Errors at the tests on the left, parameters that moved on the right; dark lines are the better ones."""
    order = np.argsort(-front.nrmsd.mean(axis=1))
    both = len(front.moved) > 1
    legend = [line_key(mode_colour(k), f"mode {name}", marker="o", ms=4) for k, name in enumerate(front.mode_nrmsd)]
    legend = [*legend[:4], line_key("#999999", "front", lw=1), line_key(FLOOR, "noise floor", lw=2)]
    panels = Panels(1 + both, 2, 2.5, legend=legend, margin=(0.65, 0.95, 0.15), gap=(0.8, 0.0))
    errors = {name: 100 * value for name, value in front.mode_nrmsd.items()}
    left = draw_front(100 * front.nrmsd[order], errors, front.objectives, panels.axes[0])
    left.plot(np.arange(len(front.objectives)), 100 * front.noise_floor, color=FLOOR, lw=2)
    left.set_ylabel("NRMSD (%)")
    left.set_ylim(0, 1.05 * 100 * float(np.nanmax(front.nrmsd)))
    if both:
        names = [math_symbol(front.parameters[k]) for k in front.moved]
        places = {name: place[front.moved] for name, place in front.mode_place.items()}
        right = draw_front(front.place[order][:, front.moved], places, names, panels.axes[1])
        right.set_ylim(-0.02, 1.02)
        right.set_yticks([0, 0.5, 1], ["lower\nbound", "", "upper\nbound"])
    best = number(100 * float(front.nrmsd.mean(axis=1).min()))
    return panels.figure(
        "Parallel coordinates of the non-dominated points",
        f"Pareto front: {len(front.nrmsd)} points of which none is better than another at every test (smallest mean "
        f"NRMSD {best} %). Left: the error of each at each test. Right: its parameters within the prior box. Dark is "
        "better.",
        good="the lines run close together: one set of parameters serves all tests.",
        bad="lines cross between tests on the left and diverge on the right: each test prefers other parameters; the "
        "model lacks something that changes between them.",
    )
