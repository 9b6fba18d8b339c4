"""Output over time with the residual below it, in the band of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import Unit, display_unit
from mofit.report.page import Figure
from mofit.report.style import (
    BASELINE,
    FLOOR,
    MEASURED,
    cluster_colour,
    few_ticks,
    image_of,
    legend_above,
    line_key,
    panels,
)

if TYPE_CHECKING:
    from mofit.report.overlay import Overlay

_COLUMNS = 3


def draw_trace(overlay: Overlay, unit: Unit, small: Unit, axes: Axes, residual: Axes) -> Axes:
    """Output in `unit` over time, and measured − simulated in `small` below it with the noise (± 2 sd)."""
    colour, time = cluster_colour(0), overlay.time
    left_over = overlay.measured - overlay.simulated
    axes.plot(time, unit.factor * overlay.measured, color=MEASURED, lw=2.6, alpha=0.35)
    residual.axhspan(
        -2 * small.factor * overlay.noise_sd, 2 * small.factor * overlay.noise_sd, color=FLOOR, alpha=0.3, lw=0
    )
    if overlay.baseline.size:
        axes.plot(time, unit.factor * overlay.baseline, color=BASELINE, ls="--", lw=1.0)
        residual.plot(time, small.factor * (overlay.measured - overlay.baseline), color=BASELINE, lw=0.8)
    axes.plot(time, unit.factor * overlay.simulated, color=colour, lw=1.2)
    if overlay.low.size:
        low, high = (small.factor * (edge - overlay.simulated) for edge in (overlay.low, overlay.high))
        residual.fill_between(time, low, high, color=colour, alpha=0.3, lw=0)
    residual.plot(time, small.factor * left_over, color=colour, lw=0.8)
    residual.axhline(0, color=MEASURED, lw=0.6)
    limit = 1.1 * small.factor * max(3 * overlay.noise_sd, float(np.max(np.abs(left_over))))
    if limit > 0:
        residual.set_ylim(-limit, limit)
    axes.set_title(overlay.test)
    axes.set_xlim(time[0], time[-1])
    few_ticks(axes)
    few_ticks(residual, None, 2)
    return axes


def traces_figure(traces: Sequence[Overlay], unit: Unit, baseline: str, solution: str) -> Figure:
    """A panel with its residual per test."""
    small = display_unit(traces[0].output_unit, np.concatenate([t.measured - t.simulated for t in traces]))
    canvas, axes, below = panels(len(traces), _COLUMNS, 1.15, lower=0.6, margin=(0.7, 0.5, 0.1, 0.65), gap=(0.55, 0.62))
    for k, overlay in enumerate(traces):
        draw_trace(overlay, unit, small, axes[k], below[k])
        if k % _COLUMNS == 0:
            for panel, label in ((axes[k], unit.name), (below[k], small.name)):
                panel.set_ylabel(label)
                panel.yaxis.set_label_coords(-0.15 if len(traces) > 2 else -0.1, 0.5)
        if k >= len(traces) - _COLUMNS:
            below[k].set_xlabel("time (s)")
    handles = [line_key(MEASURED, "measured", lw=2.6, alpha=0.35), line_key(cluster_colour(0), f"model, {solution}")]
    if baseline:
        handles.append(line_key(BASELINE, baseline, ls="--"))
    handles.append(line_key(FLOOR, "noise, ± 2 sd", lw=6, alpha=0.4))
    if any(overlay.low.size for overlay in traces):
        handles.append(line_key(cluster_colour(0), "model, 5–95 %", lw=6, alpha=0.35))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "Measured and simulated output over time with the residual, per test",
        f"Output ({traces[0].output_name}, {unit.name}) over time of solution {solution}: the last two full "
        f"periods of "
        f"periodic "
        "tests, the last samples of broadband ones. Below it the residual, measured − simulated "
        f"({small.name}).",
        good="the residual is shapeless and stays inside the noise band.",
        bad="the residual repeats every period or leaves the band: the model misses something systematic there.",
    )
