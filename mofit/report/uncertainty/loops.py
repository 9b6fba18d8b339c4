"""Posterior predictive bands over hysteresis loops: whether the measured points lie where the draws expect them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import Unit, compact, display_unit, percent
from mofit.report.overlay import output_unit
from mofit.report.page import Block, Details, Figure, Section, Table, Text
from mofit.report.run import Run
from mofit.report.style import FLOOR, MEASURED, cluster_colour, few_ticks, image_of, legend_above, line_key, panels
from mofit.report.uncertainty.predictive import NINETY, Prediction, extract_predictions

_SHOWN = 4
_LOOPS = ("sine", "quasi_static")


def draw_loop(found: Prediction, unit: Unit, axes: Axes) -> Axes:
    """Measured points and the band of the draws, over the input (over time where there is none, or no loop)."""
    overlay, f = found.overlay, unit.factor
    looped = bool(overlay.input.size) and overlay.kind in _LOOPS
    x_unit = display_unit(overlay.input_unit, overlay.input) if looped else Unit("s")
    x = x_unit.factor * overlay.input if looped else overlay.time - overlay.time[0]
    middle, half = found.middle, found.half_width
    axes.plot(x, f * overlay.measured, color=MEASURED, ls="none", marker=".", ms=3.0, rasterized=x.size > 800)
    axes.plot(x, f * middle, color=cluster_colour(0), lw=1.3)
    style: dict[str, Any] = {"color": cluster_colour(0), "lw": 0.6, "ls": "--", "alpha": 0.8}
    for edge in (middle - half, middle + half):
        axes.plot(x, f * edge, **style)
    axes.set_title(overlay.test)
    axes.set_xlabel(x_unit.label(overlay.input_name if looped else "time"), labelpad=1)
    few_ticks(axes)
    return axes


def draw_residual(found: Prediction, unit: Unit, axes: Axes) -> Axes:
    """Measured minus the mean of the draws, with the 90 % bands of the draws alone and with the noise."""
    overlay, f = found.overlay, unit.factor
    time = overlay.time - overlay.time[0]
    alone, both = f * NINETY * found.draws.std(axis=0), f * found.half_width
    axes.fill_between(time, -both, both, color=FLOOR, alpha=0.28, lw=0)
    axes.fill_between(time, -alone, alone, color=cluster_colour(0), alpha=0.55, lw=0)
    axes.plot(time, f * (overlay.measured - found.middle), color=MEASURED, lw=0.8)
    axes.set_xlim(0, max(float(time[-1]), np.finfo(float).eps))
    axes.set_xlabel("time (s)", labelpad=1)
    few_ticks(axes, 4, 4)
    return axes


def loops_section(run: Run) -> Section | None:
    """Bands over a few loops of the best solution, and for every test the share of samples inside."""
    found = extract_predictions(run, run.clusters[0])
    if not found:
        return None
    table = [
        [p.overlay.test, "–" if np.isnan(p.frequency) else compact(p.frequency, 4), percent(p.inside)] for p in found
    ]
    blocks: list[Block] = [
        Text(
            "What the posterior expects of a new measurement: the spread of the model over the draws, and the noise of "
            "the measurement on top. If model and noise are right, 90 % of the samples lie inside; far fewer mean that "
            "the model misses something which the spread of its parameters doesn't cover."
        ),
        _figure(_few(found), run.clusters[0].name),
        Details(
            "Table of the samples inside, per test",
            [Table(["Test", "Frequency (Hz)", "Inside the 90 % band"], table)],
        ),
    ]
    data = {
        "tests": [p.overlay.test for p in found],
        "inside": [p.inside for p in found],
        "band": [float(np.mean(NINETY * p.draws.std(axis=0))) for p in found],
    }
    return Section("loops", "Predictive bands over the loops", blocks, data)


def _few(found: list[Prediction]) -> list[Prediction]:
    """Some of the loops, evenly spread over the tests; of what there is if there are no loops."""
    loops = [p for p in found if p.overlay.kind in _LOOPS and p.overlay.input.size] or found
    places = np.linspace(0, len(loops) - 1, min(_SHOWN, len(loops))).round().astype(int)
    return [loops[k].last_period() for k in places]


def _figure(found: list[Prediction], solution: str) -> Figure:
    unit = output_unit([p.overlay for p in found])
    small = display_unit(found[0].overlay.output_unit, np.concatenate([p.half_width for p in found]))
    columns = len(found)
    canvas, axes, _ = panels(2 * columns, columns, 1.8, margin=(0.75, 0.5, 0.1, 0.65), gap=(0.5, 0.8))
    for k, prediction in enumerate(found):
        draw_loop(prediction, unit, axes[k])
        draw_residual(prediction, small, axes[columns + k])
        if k == 0:
            axes[0].set_ylabel(unit.label(prediction.overlay.output_name))
            axes[columns].set_ylabel(small.label("measured − mean"))
    legend_above(
        canvas,
        [
            line_key(MEASURED, "measured", ls="none", marker="."),
            line_key(cluster_colour(0), f"mean of the draws, {solution}"),
            line_key(cluster_colour(0), "90 %, draws alone", lw=6, alpha=0.6),
            line_key(FLOOR, "90 %, draws and noise", lw=6, alpha=0.4),
        ],
    )
    return Figure(
        image_of(canvas),
        "Posterior predictive bands over hysteresis loops, and the residual in them",
        "Above: output over input in the last full period, with the 90 % band of a new measurement as dashed lines. "
        "Below: the same samples over time, less the mean of the draws.",
        good="the residual fills the wide band without a shape, and rarely leaves it.",
        bad="the residual swings out of the band in the same place of every test: the model, not its parameters, "
        "is at fault there.",
    )
