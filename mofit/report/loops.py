"""Hysteresis loops: output over input in the last period, measured and simulated (Figure 10, above)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes

from mofit.report.display import Unit, display_unit
from mofit.report.page import Figure
from mofit.report.style import BASELINE, MEASURED, cluster_colour, few_ticks, image_of, legend_above, line_key, panels

if TYPE_CHECKING:
    from mofit.report.overlay import Overlay

_DENSE = 800
_COLUMNS = 4


def draw_loop(solutions: Sequence[Overlay], unit: Unit, axes: Axes) -> Axes:
    """Output over input of one test: measured points, the baseline, and a line per solution with the best on top."""
    first = solutions[0]
    x_unit = display_unit(first.input_unit, first.input)
    x = x_unit.factor * first.input
    dense: dict[str, Any] = {"rasterized": x.size > _DENSE}
    axes.plot(x, unit.factor * first.measured, color=MEASURED, ls="none", marker=".", ms=3.2, **dense)
    if first.baseline.size:
        axes.plot(x, unit.factor * first.baseline, color=BASELINE, ls="--", lw=1.2, **dense)
    for k in range(len(solutions) - 1, -1, -1):
        axes.plot(x, unit.factor * solutions[k].simulated, color=cluster_colour(k), lw=1.5 if k == 0 else 1.0, **dense)
    axes.set_title(first.test)
    axes.set_xlabel(x_unit.label(first.input_name), labelpad=1)
    few_ticks(axes)
    return axes


def loops_figure(loops: Mapping[str, Sequence[Overlay]], unit: Unit, baseline: str) -> Figure:
    """A panel per test; `loops` holds the tests of each solution, best first."""
    solutions = list(loops.values())
    count = len(solutions[0])
    canvas, axes, _ = panels(count, _COLUMNS, 1.75, margin=(0.75, 0.5, 0.1, 0.65), gap=(0.5, 0.85))
    for k, panel in enumerate(axes):
        draw_loop([overlays[k] for overlays in solutions], unit, panel)
        if k % _COLUMNS == 0:
            panel.set_ylabel(unit.label(solutions[0][k].output_name))
            panel.yaxis.set_label_coords(-0.23, 0.5)
    handles = [line_key(MEASURED, "measured", ls="none", marker=".")]
    handles += [line_key(cluster_colour(k), f"model, {name}") for k, name in enumerate(loops)]
    if baseline:
        handles.append(line_key(BASELINE, baseline, ls="--"))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "Hysteresis loops, measured and simulated, per test",
        "Output over input in the last full period of each test. The area of the loop is the energy lost per "
        "cycle, its "
        "slope the "
        "dynamic stiffness.",
        good="the model's line runs through the middle of the measured points all the way round.",
        bad="the model's loop is thinner, steeper or rounder at the ends than the measured one.",
    )
