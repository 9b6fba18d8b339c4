"""Measured and simulated signals: loops and traces (Hackl et al. 2016, Figure 10), spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mofit.report.overlay import Overlay, by_output, extract_overlays, headed, output_unit
from mofit.report.points import Points, curves_on_request, draws_figure, extract_draws, extract_fireflies
from mofit.report.run import SHOWN, Run
from mofit.report.spectra import extract_spectra, spectra_figure
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Figure, Section, Text
from mofit.report.toolkit.figures import (
    BASELINE,
    FLOOR,
    MEASURED,
    Panels,
    band_key,
    baseline_key,
    dot_key,
    line_key,
    mode_colour,
    panel_of,
)
from mofit.report.toolkit.formatting import Unit, display_unit, percent, whole_percent

_DENSE = 800
"""Samples from which a curve is rasterised."""


def draw_loop(overlays: Sequence[Overlay], unit: Unit, axes: Axes, *, predictive: bool = False) -> Axes:
    """Output over input of one test, over time where it has no loop.

    Measured points, the baseline, and a line per mode with the best on top; with `predictive` instead the mean of the
    best mode's draws and the 90 % band of a new measurement.
    """
    first = overlays[0]
    looped = first.loops or not predictive
    x_unit = display_unit(first.input_unit, first.input) if looped else Unit("s")
    x = x_unit.factor * first.input if looped else first.time - first.time[0]
    dense: dict[str, Any] = {"rasterized": x.size > _DENSE}
    axes.plot(x, unit.factor * first.measured, color=MEASURED, ls="none", marker=".", ms=3.2, **dense)
    if predictive:
        axes.plot(x, unit.factor * first.middle, color=mode_colour(0), lw=1.3)
        for edge in (-first.predictive_band, first.predictive_band):
            axes.plot(x, unit.factor * (first.middle + edge), color=mode_colour(0), lw=0.6, ls="--", alpha=0.8)
    else:
        if first.baseline.size:
            axes.plot(x, unit.factor * first.baseline, color=BASELINE, ls="--", lw=1.2, **dense)
        for k, overlay in reversed([*enumerate(overlays)]):
            axes.plot(x, unit.factor * overlay.simulated, color=mode_colour(k), lw=1.5 if k == 0 else 1.0, **dense)
    panel_of(axes, first.test)
    axes.set_xlabel(x_unit.label(first.input_name if looped else "time"), labelpad=1)
    few_ticks(axes)
    return axes


def draw_trace(overlay: Overlay, unit: Unit, small: Unit, axes: Axes, residual: Axes) -> Axes:
    """Output in `unit` over time, and measured − simulated in `small` below it with the noise (± 2 sd)."""
    colour, time = mode_colour(0), overlay.time
    remaining = overlay.measured - overlay.simulated
    axes.plot(time, unit.factor * overlay.measured, color=MEASURED, lw=2.6, alpha=0.35)
    noise = 2 * small.factor * overlay.noise_sd
    residual.axhspan(-noise, noise, color=FLOOR, alpha=0.3, lw=0)
    if overlay.baseline.size:
        axes.plot(time, unit.factor * overlay.baseline, color=BASELINE, ls="--", lw=1.0)
        residual.plot(time, small.factor * (overlay.measured - overlay.baseline), color=BASELINE, lw=0.8)
    axes.plot(time, unit.factor * overlay.simulated, color=colour, lw=1.2)
    if overlay.draws.size:
        low, high = small.factor * (overlay.quantiles - overlay.simulated)
        residual.fill_between(time, low, high, color=colour, alpha=0.3, lw=0)
    residual.plot(time, small.factor * remaining, color=colour, lw=0.8)
    residual.axhline(0, color=MEASURED, lw=0.6)
    limit = 1.1 * small.factor * max(3 * overlay.noise_sd, float(np.max(np.abs(remaining))))
    if limit > 0:
        residual.set_ylim(-limit, limit)
    panel_of(axes, overlay.test)
    axes.set_xlim(time[0], time[-1])
    few_ticks(axes)
    few_ticks(residual, None, 2)
    return axes


def _loops_figure(
    loops: Mapping[str, Sequence[Overlay]], unit: Unit, baseline: str, output: str, offered: Sequence[Points]
) -> Figure:
    """A panel per test; `loops` holds the tests of each mode, best first. `output` is its name, of several."""
    modes = list(loops.values())
    legend = [dot_key(MEASURED, "measured", marker=".")]
    legend += [line_key(mode_colour(k), f"model, {name}") for k, name in enumerate(loops)]
    legend += baseline_key(baseline)
    panels = Panels(len(modes[0]), 4, 1.75, legend=legend, margin=(0.75, 0.5, 0.1), gap=(0.5, 0.85))
    for k, axes in enumerate(panels.axes):
        draw_loop([overlays[k] for overlays in modes], unit, axes)
        best = modes[0][k]
        curves_on_request(
            panels, axes, offered, best, display_unit(best.input_unit, best.input).factor * best.input, unit
        )
    panels.label(y=unit.label(modes[0][0].output_name))
    return panels.figure(
        headed("Hysteresis loops, measured and simulated, per test", output),
        "Output over input in the last full period of each test. The area of the loop is the energy lost per cycle, "
        "its slope the dynamic stiffness.",
        good="the model's line runs through the middle of the measured points all the way round.",
        bad="the model's loop is thinner, steeper or rounder at the ends than the measured one.",
        finding=_farthest(modes[0]),
    )


def _farthest(overlays: Sequence[Overlay]) -> str:
    """The tests that the model follows best and worst, by what is left relative to the range."""
    left = [float(np.sqrt(np.mean((o.measured - o.simulated) ** 2)) / (np.ptp(o.measured) or 1.0)) for o in overlays]
    worst, best = int(np.argmax(left)), int(np.argmin(left))
    if len(overlays) == 1:
        return f"The model leaves {percent(left[0])} of the range of {overlays[0].test}."
    return (
        f"The model leaves most of {overlays[worst].test} ({percent(left[worst])} of its range) and least of "
        f"{overlays[best].test} ({percent(left[best])})."
    )


def _beyond_noise(overlays: Sequence[Overlay]) -> str:
    """How many samples lie inside the noise band, and where fewest do."""
    inside = [float(np.mean(np.abs(o.measured - o.simulated) <= 2 * o.noise_sd)) for o in overlays]
    worst = int(np.argmin(inside))
    return (
        f"{whole_percent(float(np.mean(inside)))} of the drawn samples lie inside the noise band (white noise: 95 %), "
        f"fewest in {overlays[worst].test} ({whole_percent(inside[worst])})."
    )


def _traces_figure(
    traces: Sequence[Overlay], unit: Unit, baseline: str, mode: str, output: str, offered: Sequence[Points]
) -> Figure:
    """A panel with its residual per test."""
    small = display_unit(traces[0].output_unit, np.concatenate([t.measured - t.simulated for t in traces]))
    legend = [line_key(MEASURED, "measured", lw=2.6, alpha=0.35), line_key(mode_colour(0), f"model, {mode}")]
    legend += [*baseline_key(baseline), band_key(FLOOR, "noise, ± 2 sd")]
    if any(overlay.draws.size for overlay in traces):
        legend.append(band_key(mode_colour(0), "model, 5–95 %", 0.35))
    panels = Panels(len(traces), 3, 1.15, legend=legend, lower=0.6, margin=(0.7, 0.5, 0.1), gap=(0.55, 0.62))
    for overlay, axes, below in zip(traces, panels.axes, panels.lower, strict=True):
        draw_trace(overlay, unit, small, axes, below)
        curves_on_request(panels, axes, offered, overlay, overlay.time, unit)
        curves_on_request(panels, below, offered, overlay, overlay.time, small, overlay.simulated)
    panels.label("time (s)", unit.label(traces[0].output_name), small.label("residual"))
    return panels.figure(
        headed("Measured and simulated output over time with the residual, per test", output),
        f"Output ({traces[0].output_name}, {unit.name}) over time of mode {mode}: the last two full periods of "
        f"periodic tests, the last samples of broadband ones. Below: measured − simulated ({small.name}).",
        good="the residual is shapeless and stays inside the noise band.",
        bad="the residual repeats every period or leaves the band: the model misses something systematic there.",
        finding=_beyond_noise(traces),
    )


def signals_section(run: Run) -> Section | None:
    """Loops of all modes; traces and spectra of the best."""
    by_mode = {mode.name: found for mode in run.shown if (found := extract_overlays(run, mode))}
    name = run.best.name
    if name not in by_mode:
        return None
    best = by_mode[name]
    baseline = run.baseline_title if any(overlay.baseline.size for overlay in best) else ""
    loops = {key: [o.last(1) for o in overlays if o.loops] for key, overlays in by_mode.items()}
    traces, spectra = [o.last(2) for o in best], extract_spectra(best)
    blocks: list[Block] = []
    draws = extract_draws(run.best)
    offered = [points for points in (draws, extract_fireflies(run)) if points is not None]
    for output, whole in by_output(best).items():
        unit, tests = output_unit(whole), {o.test for o in whole}
        of_output = {key: [o for o in found if o.test in tests] for key, found in loops.items()}
        if of_output[name]:
            blocks.append(_loops_figure(of_output, unit, baseline, output, offered))
        shown = [o for o in traces if o.test in tests]
        blocks.append(_traces_figure(shown, unit, baseline, name, output, offered))
        if own := [spectrum for spectrum in spectra if spectrum.test in tests]:
            blocks.append(spectra_figure(own, unit, baseline, name, output))
    if draws is not None and len(draws.names) > 1:
        blocks.append(draws_figure(run, run.best, draws))
    if len(run.modes) > SHOWN:
        blocks.append(Text(f"The figures show the {SHOWN} best modes; the tables list all {len(run.modes)}."))
    data = {
        "loops": {key: [overlay.summary() for overlay in found] for key, found in loops.items()},
        "traces": [overlay.summary() for overlay in traces],
        "spectra": spectra,
    }
    return Section("signals", "Measured and simulated", blocks, data)
