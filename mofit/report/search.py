"""The search: what it found, the swarm, its convergence, its Pareto front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.search_map import SearchMap, extract_search, extract_swarm, map_figure, moved, swarm_figure
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Figure, Section, Text
from mofit.report.toolkit.description import bundled, keyed, test_of
from mofit.report.toolkit.figures import FLOOR, MEASURED, Panels, line_key, mode_colour
from mofit.report.toolkit.formatting import count, math_symbol, number, percent
from mofit.results import simulations, simulations_line


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
        known = dict(zip(run.objective_names, values, strict=True))
        return np.array([known.get(objective, np.nan) for objective in objectives])

    return Front(
        objectives=objectives,
        parameters=names,
        moved=moved(place),
        nrmsd=numbers(node, "nrmsd"),
        place=place,
        noise_floor=of_objectives(run.of_objectives("noise_floor")),
        mode_nrmsd={mode.name: of_objectives(run.of_objectives("nrmsd", mode.node)) for mode in same},
        mode_place={mode.name: space.to_unit(mode.array("value")) for mode in same},
    )


def search_section(run: Run) -> Section | None:
    """Maps of the search, its convergence, and the front."""
    found, growth, front = extract_search(run), _extract_growth(run), extract_front(run)
    swarm = extract_swarm(run)
    blocks: list[Block] = []
    if found is not None:
        blocks += [Text(_summary(run, found)), map_figure(found)]
    if swarm is not None and len(swarm.search.moved) > 1:
        blocks.append(swarm_figure(swarm))
    if growth is not None:
        blocks.append(_growth_figure(growth))
    if front is not None and len(front.objectives) > 1:
        blocks.append(_front_figure(front))
    return Section("search", "Search", blocks, {"search": found, "front": front}) if blocks else None


def _summary(run: Run, found: SearchMap) -> str:
    node = run.tree["search"]
    attrs = node.attrs
    text = f"The search ({attrs['method']}) evaluated {count(attrs['evaluations'])} points of the prior box. "
    if "found_by" in node.data_vars:
        stages = [str(stage) for stage in node["found_by"].to_numpy()]
        text += (
            f"The clusters of the swarm led to {stages.count('swarm')} minima of the mean over the tests and of single "
            f"tests; the completion added {len(stages) - stages.count('swarm')}. "
        )
    else:
        text += f"It archived {len(found.archived)} of them as minima or best points of clusters. "
    if (simulated := simulations(run.tree)) is not None:
        text += f"The whole identification took {simulations_line(simulated)} "
    text += f"Refinement led to {len(run.modes)} distinct mode{'' if len(run.modes) == 1 else 's'}."
    undiscovered = float(attrs.get("expected_undiscovered_minima", np.nan))
    if attrs.get("complete", -1) == 0 and not np.isfinite(undiscovered):
        return f"{text} The search was not complete: how many minima are undiscovered is not known."
    if not np.isfinite(undiscovered):
        return text
    text += f" Expected undiscovered minima of the mean over the tests: {number(undiscovered, 2)}"
    return f"{text}." if attrs.get("complete", 1) else f"{text}, when the budget was spent."


def _growth_figure(growth: Growth) -> Figure:
    """Two curves over the number of evaluations."""
    panels = Panels(2, 3, 1.8, gap=(0.85, 0.0), top=0.2)
    curves = {"least mean NRMSD (%)": 100 * growth.best, "hypervolume (–)": growth.hypervolume}
    for axes, (label, values) in zip(panels.axes, curves.items(), strict=True):
        axes.plot(growth.evaluations, values, color=MEASURED, marker="o", ms=3.5)
        axes.set_ylabel(label)
        few_ticks(axes)
    panels.label("evaluations")
    panels.axes[1].set_ylim(0, 1.02)
    last = growth.evaluations[np.argmax(growth.best <= growth.best[-1] * (1 + 1e-9))]
    return panels.figure(
        "Best point and hypervolume of the front over the evaluations of the search",
        "Left: the best point so far. Right: the hypervolume, which is the share of the box from best to median of "
        "every objective that the front dominates. It grows as long as the front improves.",
        good="both curves are flat at the end: more evaluations would find nothing new.",
        bad="a curve still moves at the end: give the search a larger budget.",
        finding=f"The best point has not changed since evaluation {count(last)} of {count(growth.evaluations[-1])}.",
    )


def _draw_front(
    values: FloatArray, modes: dict[str, FloatArray], names: list[str], axes: Axes, *, tests: bool = False
) -> Axes:
    """Parallel coordinates: a line per point, a thick line per mode."""
    x = np.arange(values.shape[1])
    lines = LineCollection(
        [np.column_stack([x, row]) for row in values], cmap="Greys", lw=0.7, alpha=0.6, label="front"
    )
    lines.set_array(np.linspace(0.3, 0.95, len(values)))
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    bundled(lines)
    for k, line in reversed([*enumerate(modes.values())]):
        axes.plot(x, line, color=mode_colour(k), lw=2.2, marker="o", ms=4)
    crowded = len(names) > 6
    axes.set_xticks(x, names, rotation=40 if crowded else 0, ha="right" if crowded else "center")
    axes.set_xlim(-0.15, max(len(names) - 0.85, 0.15))
    if tests:
        keyed(axes.xaxis, test=[test_of(name) for name in names])
    axes.grid(visible=True, axis="x")
    return axes


def _torn(front: Front) -> str:
    """How much the point that is best on the whole gives away at the test where it gives away most."""
    least, best = front.nrmsd.min(axis=0), front.nrmsd[np.argmin(front.nrmsd.mean(axis=1))]
    lost = best / np.maximum(least, np.finfo(float).tiny) - 1
    k = int(np.argmax(lost))
    smaller = percent(lost[k] / (1 + lost[k]))
    return f"Its point gives away most at {front.objectives[k]}: the least error there is {smaller} smaller."


def _front_figure(front: Front) -> Figure:
    """Errors at the tests on the left, parameters that moved on the right; dark lines are the better ones."""
    order = np.argsort(-front.nrmsd.mean(axis=1))
    both = len(front.moved) > 1
    legend = [line_key(mode_colour(k), f"mode {name}", marker="o", ms=4) for k, name in enumerate(front.mode_nrmsd)]
    legend = [*legend[:4], line_key("#999999", "front", lw=1), line_key(FLOOR, "noise floor", lw=2)]
    panels = Panels(1 + both, 2, 2.5, legend=legend, margin=(0.65, 0.95, 0.15), gap=(0.8, 0.0))
    errors = {name: 100 * value for name, value in front.mode_nrmsd.items()}
    left = _draw_front(100 * front.nrmsd[order], errors, front.objectives, panels.axes[0], tests=True)
    left.plot(np.arange(len(front.objectives)), 100 * front.noise_floor, color=FLOOR, lw=2)
    left.set_ylabel("NRMSD (%)")
    left.set_ylim(0, 1.05 * 100 * float(np.nanmax(front.nrmsd)))
    if both:
        names = [math_symbol(front.parameters[k]) for k in front.moved]
        places = {name: place[front.moved] for name, place in front.mode_place.items()}
        right = _draw_front(front.place[order][:, front.moved], places, names, panels.axes[1])
        right.set_ylim(-0.02, 1.02)
        right.set_ylabel("place in the prior box")
        right.set_yticks([0, 0.5, 1], ["lower", "", "upper"])
    best = number(100 * float(front.nrmsd.mean(axis=1).min()))
    return panels.figure(
        "Parallel coordinates of the non-dominated points",
        "Pareto front: points, none of them better than another at every test. Left: the error of each point at each "
        "test. Right: its parameters within the prior box. Dark is better. Draw a box across some lines to keep those "
        "that run through it, or move one along the axes with the arrow keys.",
        good="the lines run close together: one set of parameters serves all tests.",
        bad="lines cross between tests on the left and diverge on the right: each test prefers other parameters; the "
        "model lacks something that changes between them.",
        finding=f"{len(front.nrmsd)} points; the smallest mean NRMSD is {best} %. {_torn(front)}",
        brush=True,
    )
