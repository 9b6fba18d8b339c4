"""Posterior predictive bands over hysteresis loops: whether the measured points lie where the draws expect them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mofit.report.overlay import Overlay, by_output, extract_overlays, headed, output_unit
from mofit.report.run import Run
from mofit.report.signals import draw_loop
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Column, Details, Figure, Section, Table, Text
from mofit.report.toolkit.figures import FLOOR, MEASURED, Panels, band_key, dot_key, line_key, mode_colour, panel_of
from mofit.report.toolkit.formatting import Unit, compact, display_unit, percent

_SHOWN = 4
"""Loops that are drawn."""


def predictions(run: Run) -> list[Overlay]:
    """Every test of which the best mode holds simulated draws."""
    return [overlay for overlay in extract_overlays(run, run.best) if overlay.draws.size]


def draw_residual(overlay: Overlay, unit: Unit, axes: Axes) -> Axes:
    """Measured minus the mean of the draws, with the 90 % bands of the draws alone and with the noise."""
    time = overlay.time - overlay.time[0]
    bands = (overlay.predictive_band, FLOOR, 0.28), (overlay.parameter_band, mode_colour(0), 0.55)
    for half, colour, alpha in bands:
        axes.fill_between(time, -unit.factor * half, unit.factor * half, color=colour, alpha=alpha, lw=0)
    axes.plot(time, unit.factor * (overlay.measured - overlay.middle), color=MEASURED, lw=0.8)
    axes.set_xlim(0, max(float(time[-1]), np.finfo(float).eps))
    axes.set_xlabel("time (s)", labelpad=1)
    few_ticks(axes, 4, 4)
    return axes


def loops_section(run: Run) -> Section | None:
    """Bands over a few loops of the best mode, and for every test the share of samples inside."""
    found = predictions(run)
    if not found:
        return None
    tests, inside = [overlay.test for overlay in found], [overlay.inside for overlay in found]
    table = Table(
        [
            Column("Test", tests),
            Column("Frequency (Hz)", [compact(overlay.frequency, 4) for overlay in found]),
            Column("Inside the 90 % band", [percent(share) for share in inside]),
        ]
    )
    text = Text(
        "The posterior predicts a band for a new measurement: the model at the draws, plus the noise of the "
        "measurement. If model and noise are right, 90 % of the samples lie inside. If far fewer do, the model misses "
        "something that the uncertainty of its parameters does not cover."
    )
    blocks: list[Block] = [
        text,
        *(_figure(_few(own), run.best.name, output) for output, own in by_output(found).items()),
        Details("Table of the samples inside, per test", [table]),
    ]
    data = {"tests": tests, "inside": inside, "band": [float(np.mean(o.parameter_band)) for o in found]}
    return Section("loops", "Predictive bands over the loops", blocks, data)


def _few(found: list[Overlay]) -> list[Overlay]:
    """Some of the loops, evenly spread over the tests; of all tests where there are no loops."""
    loops = [overlay for overlay in found if overlay.loops] or found
    places = np.linspace(0, len(loops) - 1, min(_SHOWN, len(loops))).round().astype(int)
    return [loops[k].last(1) for k in places]


def _fewest_inside(found: list[Overlay]) -> str:
    """The test of which the fewest samples lie inside the band."""
    worst = min(found, key=lambda overlay: overlay.inside)
    return f"Fewest samples lie inside the band in {worst.test}: {percent(worst.inside)} (expected: 90 %)."


def _figure(found: list[Overlay], mode: str, output: str) -> Figure:
    unit = output_unit(found)
    small = display_unit(found[0].output_unit, np.concatenate([overlay.predictive_band for overlay in found]))
    legend = [
        dot_key(MEASURED, "measured", marker="."),
        line_key(mode_colour(0), f"mean of the draws, {mode}"),
        line_key(mode_colour(0), "90 %, draws and noise", lw=0.6, ls="--"),
        band_key(mode_colour(0), "90 %, draws alone", 0.6),
        band_key(FLOOR, "90 %, draws and noise"),
    ]
    columns = len(found)
    panels = Panels(2 * columns, columns, 1.8, legend=legend, margin=(0.75, 0.5, 0.1), gap=(0.5, 0.8))
    for overlay, above, below in zip(found, panels.axes[:columns], panels.axes[columns:], strict=True):
        draw_loop([overlay], unit, above, predictive=True)
        draw_residual(overlay, small, below)
        panel_of(below, overlay.test)
    panels.axes[0].set_ylabel(unit.label(found[0].output_name))
    panels.axes[columns].set_ylabel(small.label("measured − mean"))
    return panels.figure(
        headed("Posterior predictive bands over hysteresis loops, and the residual in them", output),
        "Above: output over input in the last full period, with the 90 % band of a new measurement as dashed lines. "
        "Below: the same samples over time, less the mean of the draws.",
        good="the residual fills the wide band without a shape, and rarely leaves it.",
        bad="the residual leaves the band in the same place of every test: the model is wrong there, not its "
        "parameters.",
        finding=_fewest_inside(found),
    )
