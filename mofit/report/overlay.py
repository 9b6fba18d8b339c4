"""Measured beside simulated: hysteresis loops, time traces with their residual, spectra of broadband tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mofit.report.display import Unit, display_unit
from mofit.report.page import Block, Figure, Section, Text, tabs
from mofit.report.run import SHOWN, Array, Cluster, Run, tab_title
from mofit.report.style import BASELINE, FLOOR, MEASURED, cluster_colour, few_ticks, image_of, legend_above
from mofit.report.style import line_key, panels

_BROADBAND = ("multisine", "chirp", "free")
_TRACE_SAMPLES = 400
"""Samples of a broadband test that are shown; more would be a solid block."""


@dataclass(frozen=True)
class Overlay:
    """One test: the samples that counted, measured and simulated, SI units; empty arrays where a run has none."""

    test: str
    kind: str
    period: float
    input_name: str
    input_unit: str
    output_unit: str
    time: Array
    input: Array
    measured: Array
    simulated: Array
    baseline: Array
    low: Array
    high: Array
    noise_sd: float


def extract_overlays(run: Run, cluster: Cluster) -> list[Overlay]:
    """Every test that the cluster predicts, without the samples that were dropped."""
    if "prediction" not in cluster.node.children:
        return []
    prediction = cluster.node.children["prediction"]
    return [_overlay(run, cluster, k, test) for k, test in enumerate(run.tests) if test in prediction.data_vars]


def _overlay(run: Run, cluster: Cluster, index: int, test: str) -> Overlay:
    observed, constant = run.tree["observed_data"][test], run.tree["constant_data"]
    channels = [
        name for name, v in constant.data_vars.items() if v.dims == (f"time_{test}",) and name != f"{test}_weight"
    ]
    driver = constant[channels[0]] if channels else None
    weight = constant[f"{test}_weight"].values if f"{test}_weight" in constant.data_vars else np.ones(observed.size)
    kept = weight > 0
    low, high = _band(cluster, test)
    return Overlay(
        test=test,
        kind=run.kinds[index],
        period=float(run.of_tests("period")[index]),
        input_name=str(channels[0]).removeprefix(f"{test}_").replace("_", " ") if channels else "",
        input_unit=str(driver.attrs["units"]) if driver is not None else "1",
        output_unit=str(observed.attrs["units"]),
        time=np.asarray(observed[f"time_{test}"].values, dtype=float)[kept],
        input=np.asarray(driver.values, dtype=float)[kept] if driver is not None else np.empty(0),
        measured=np.asarray(observed.values, dtype=float)[kept],
        simulated=np.asarray(cluster.node[f"prediction/{test}"].values, dtype=float)[kept],
        baseline=_baseline(run.tree, test, kept),
        low=low[kept] if low.size else low,
        high=high[kept] if high.size else high,
        noise_sd=float(run.of_tests("noise_sd")[index]),
    )


def _baseline(tree: xr.DataTree, test: str, kept: np.ndarray) -> Array:
    if "baseline" not in tree.children or "prediction" not in tree["baseline"].children:
        return np.empty(0)
    prediction = tree["baseline/prediction"]
    return np.asarray(prediction[test].values, dtype=float)[kept] if test in prediction.data_vars else np.empty(0)


def _band(cluster: Cluster, test: str) -> tuple[Array, Array]:
    """5 % and 95 % quantile of the model's output over the posterior."""
    predictive = cluster.node.children.get("posterior_predictive")
    if predictive is None or test not in predictive.data_vars:
        return np.empty(0), np.empty(0)
    draws = predictive[test].values.reshape(-1, predictive[test].shape[-1])
    ordered = np.sort(draws, axis=0)
    last = len(ordered) - 1
    return ordered[round(0.05 * last)].astype(float), ordered[round(0.95 * last)].astype(float)


def window(overlay: Overlay, periods: float) -> slice:
    """The last `periods` periods; of a broadband test a short piece; else everything."""
    n, step = overlay.time.size, np.median(np.diff(overlay.time)) if overlay.time.size > 1 else 1.0
    if overlay.kind in _BROADBAND:
        return slice(max(0, n - _TRACE_SAMPLES), n)
    if np.isfinite(overlay.period) and overlay.period > 0:
        return slice(max(0, n - round(periods * overlay.period / step) - 1), n)
    return slice(0, n)


def draw_loop(overlay: Overlay, colour: str, axes: Axes) -> Axes:
    """Output over input in the last period."""
    part = window(overlay, 1.0)
    x_unit, y_unit = _units(overlay)
    x = x_unit.factor * overlay.input[part]
    axes.plot(x, y_unit.factor * overlay.measured[part], color=MEASURED, ls="none", marker=".", ms=2.6, rasterized=x.size > 800)
    if overlay.baseline.size:
        axes.plot(x, y_unit.factor * overlay.baseline[part], color=BASELINE, ls="--", lw=1.2)
    axes.plot(x, y_unit.factor * overlay.simulated[part], color=colour, lw=1.5)
    axes.set_title(overlay.test)
    axes.set_xlabel(x_unit.label(overlay.input_name), labelpad=1)
    few_ticks(axes)
    return axes


def draw_trace(overlay: Overlay, colour: str, axes: Axes, residual: Axes) -> Axes:
    """Output over time, and measured − simulated below it in the band of the noise (± 2 sd)."""
    part = window(overlay, 2.0)
    factor = _units(overlay)[1].factor
    time, measured = overlay.time[part], factor * overlay.measured[part]
    axes.plot(time, measured, color=MEASURED, lw=2.4, alpha=0.35)
    if overlay.baseline.size:
        axes.plot(time, factor * overlay.baseline[part], color=BASELINE, ls="--", lw=1.0)
    axes.plot(time, factor * overlay.simulated[part], color=colour, lw=1.2)
    axes.set_title(overlay.test)
    residual.axhspan(-2 * factor * overlay.noise_sd, 2 * factor * overlay.noise_sd, color=FLOOR, alpha=0.25, lw=0)
    if overlay.baseline.size:
        residual.plot(time, measured - factor * overlay.baseline[part], color=BASELINE, lw=0.8)
    residual.plot(time, measured - factor * overlay.simulated[part], color=colour, lw=0.9)
    if overlay.low.size:
        centre = factor * overlay.simulated[part]
        residual.fill_between(
            time, factor * overlay.low[part] - centre, factor * overlay.high[part] - centre, color=colour, alpha=0.3, lw=0
        )
    residual.axhline(0, color=MEASURED, lw=0.6)
    limit = 1.15 * factor * max(3 * overlay.noise_sd, float(np.max(np.abs(overlay.measured[part] - overlay.simulated[part]))))
    residual.set_ylim(-limit, limit)
    axes.set_xlim(time[0], time[-1])
    few_ticks(axes)
    few_ticks(residual, None, 2)
    return axes


def draw_spectrum(overlay: Overlay, colour: str, axes: Axes) -> Axes:
    """Amplitude spectra of the output, of what is left over, and the level of white noise."""
    n, step = overlay.time.size, float(np.median(np.diff(overlay.time)))
    frequency = np.fft.rfftfreq(n, step)[1:]
    factor = _units(overlay)[1].factor
    scale = 2 * factor / n
    lines = ((overlay.measured, MEASURED), (overlay.baseline - overlay.measured if overlay.baseline.size else None, BASELINE))
    for signal, tone in (*lines, (overlay.measured - overlay.simulated, colour)):
        if signal is not None:
            axes.plot(
                frequency, scale * np.abs(np.fft.rfft(signal))[1:], color=tone, ls="none", marker=".", ms=2, rasterized=True
            )
    axes.axhline(factor * overlay.noise_sd * np.sqrt(np.pi / n), color=FLOOR, lw=2)
    axes.set_yscale("log")
    axes.set_title(overlay.test)
    axes.set_xlabel("frequency (Hz)")
    return axes


def _units(overlay: Overlay) -> tuple[Unit, Unit]:
    return display_unit(overlay.input_unit, overlay.input), display_unit(overlay.output_unit, overlay.measured)


def overlay_section(run: Run) -> Section | None:
    """Loops, traces and spectra per cluster."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for cluster in run.shown:
        overlays = extract_overlays(run, cluster)
        if overlays:
            data[cluster.name] = overlays
            panes[tab_title(cluster)] = _pane(run, overlays, cluster)
    if not panes:
        return None
    blocks: list[Block] = [*tabs(panes)]
    if len(run.clusters) > SHOWN:
        blocks.append(Text(f"Drawn are the {SHOWN} best solutions; the tables list all {len(run.clusters)}."))
    return Section("overlay", "Measured and simulated", blocks, {"clusters": data})


def _pane(run: Run, overlays: list[Overlay], cluster: Cluster) -> list[Block]:
    colour = cluster_colour(cluster.index)
    handles = [line_key(MEASURED, "measured", ls="none", marker="."), line_key(colour, f"model, {cluster.name}")]
    if any(overlay.baseline.size for overlay in overlays):
        handles.append(line_key(BASELINE, str(run.tree["baseline"].attrs["model_title"]), ls="--"))
    blocks: list[Block] = []
    loops = [o for o in overlays if o.input.size and o.kind in ("sine", "quasi_static")]
    if loops:
        canvas, axes, _ = panels(len(loops), 4, 1.75, margin=(0.65, 0.5, 0.1, 0.65), gap=(0.5, 0.85))
        for k, (overlay, panel) in enumerate(zip(loops, axes, strict=True)):
            draw_loop(overlay, colour, panel)
            if k % 4 == 0:
                panel.set_ylabel(_units(overlay)[1].label("output"))
        legend_above(canvas, handles)
        blocks.append(
            Figure(
                image_of(canvas),
                "Hysteresis loops, measured and simulated, per test",
                "Output over input in the last period of each test. The area of the loop is the energy lost per cycle, its slope "
                "the dynamic stiffness.",
                good="the model's line runs through the middle of the measured points all the way round.",
                bad="the model's loop is thinner, steeper or rounder at the ends than the measured one.",
            )
        )
    blocks.append(_traces(overlays, colour, handles))
    spectra = [o for o in overlays if o.kind in _BROADBAND and o.time.size > 16]
    if spectra:
        blocks.append(_spectra(spectra, colour, handles))
    return blocks


def _traces(overlays: list[Overlay], colour: str, handles: list) -> Figure:
    canvas, axes, below = panels(len(overlays), 3, 1.15, lower=0.6, margin=(0.65, 0.5, 0.1, 0.65), gap=(0.55, 0.62))
    for k, overlay in enumerate(overlays):
        draw_trace(overlay, colour, axes[k], below[k])
        if k % 3 == 0:
            unit = _units(overlay)[1]
            axes[k].set_ylabel(unit.label("output"))
            below[k].set_ylabel("residual")
        if k >= len(overlays) - 3:
            below[k].set_xlabel("time (s)")
    extra = [line_key(FLOOR, "noise, ± 2 sd", lw=6, alpha=0.4), line_key(colour, "model, 5–95 %", lw=6, alpha=0.35)]
    legend_above(canvas, [*handles, *extra])
    return Figure(
        image_of(canvas),
        "Measured and simulated output over time with the residual, per test",
        "Output over time (the last two periods of periodic tests), and below it the residual, measured − simulated.",
        good="the residual is shapeless and stays inside the noise band.",
        bad="the residual repeats every period or leaves the band: the model misses something systematic there.",
    )


def _spectra(overlays: list[Overlay], colour: str, handles: list) -> Figure:
    canvas, axes, _ = panels(len(overlays), 2, 2.1, margin=(0.75, 0.5, 0.1, 0.65))
    for overlay, panel in zip(overlays, axes, strict=True):
        draw_spectrum(overlay, colour, panel)
        panel.set_ylabel(_units(overlay)[1].label("amplitude"))
    names = [handles[0], line_key(colour, "left over by the model", ls="none", marker=".")]
    if len(handles) > 2:
        names.append(line_key(BASELINE, "left over by the baseline", ls="none", marker="."))
    legend_above(canvas, [*names, line_key(FLOOR, "noise level", lw=2)])
    return Figure(
        image_of(canvas),
        "Amplitude spectra of output and residual per broadband test",
        "Amplitude spectrum of the output and of what the model leaves over.",
        good="what is left over lies on the noise level at all frequencies.",
        bad="peaks above the noise level: near a resonance the frequency or damping is off, between the excited lines a "
        "nonlinearity is missing.",
    )
