"""What both models leave of every test: its spectrum by classes of lines, and its time trace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import NullLocator

from mofit.report.toolkit.blocks import Block, Figure, Section
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import BASELINE, FLOOR, Panels, dot_key, line_key, mode_colour, panel_of
from mofit.report.toolkit.formatting import Unit, display_unit, number, whole_percent

BEFORE, AFTER = "without effects", "with the best model"
"""The two models that a page of a diagnosis compares."""
MODELS = (("before", BEFORE, BASELINE), ("after", AFTER, mode_colour(0)))
"""Their key in the data, name and colour."""
MOST = 16
"""Records that are drawn."""
COLUMNS = 4


def residuals_section(data: Mapping[str, Any]) -> Section:
    """Spectra and time traces of every output."""
    records, figures = data["records"], list[Block]()
    for name in dict.fromkeys(one["output_name"] for one in records):
        own = [one for one in records if one["output_name"] == name][:MOST]
        residuals = [np.asarray(one["measured"]) - np.asarray(one["before"]) for one in own]
        unit = display_unit(own[0]["output_unit"], np.concatenate(residuals))
        figures += [_spectra(own, unit), _traces(own, unit)]
    return Section("residuals", "The residual of every test", figures)


def _spectra(records: Sequence[Mapping[str, Any]], unit: Unit) -> Figure:
    """Amplitudes of the residual as dots, each with its class of lines, and the noise as a line."""
    legend = [dot_key(colour, name, marker=".") for _, name, colour in MODELS] + [line_key(FLOOR, "noise", lw=1.5)]
    panels = Panels(len(records), COLUMNS, 1.6, legend=legend, margin=(0.75, 0.5, 0.1), gap=(0.5, 0.7))
    for axes, one in zip(panels.axes, records, strict=True):
        found = one["spectrum"]
        frequency = np.asarray(found["frequency"])
        for key, model, colour in MODELS:
            amplitude = unit.factor * np.asarray(found[key])
            (dots,) = axes.plot(frequency, amplitude, color=colour, ls="none", marker=".", ms=2.5, rasterized=True)
            keyed(dots, model=model, lines=list(found["lines"]))
        axes.plot(frequency, unit.factor * np.asarray(found["noise"]), color=FLOOR, lw=1.5)
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_minor_locator(NullLocator())  # most of the time to draw a panel
        axes.set_ylim(bottom=0.05 * unit.factor * max(float(np.min(found["noise"])), np.finfo(float).tiny))
        panel_of(axes, one["test"])
    panels.label("frequency (Hz)", unit.label("amplitude"))
    return panels.figure(
        "Spectra of the residual per test, before and after, beside the noise",
        "Amplitude spectrum of measured minus simulated. A class of lines that is chosen stands out.",
        good="the blue dots scatter around the noise.",
        bad="blue dots stand above it at multiples of the excitation frequency.",
        finding=_highest(records),
    )


def _highest(records: Sequence[Mapping[str, Any]]) -> str:
    """The line that stands highest above the noise without effects, and what is left of it."""
    ratios = [np.asarray(one["spectrum"]["before"]) / np.asarray(one["spectrum"]["noise"]) for one in records]
    k = int(np.argmax([ratio.max(initial=0.0) for ratio in ratios]))
    line, found = int(np.argmax(ratios[k])), records[k]["spectrum"]
    after = found["after"][line] / found["noise"][line]
    return (
        f"Without effects the residual is highest in {records[k]['test']} at {number(found['frequency'][line])} Hz: "
        f"{number(float(ratios[k][line]), 2)}× the noise; with the best model {number(float(after), 2)}×."
    )


def _traces(records: Sequence[Mapping[str, Any]], unit: Unit) -> Figure:
    legend = [line_key(colour, name) for _, name, colour in MODELS]
    panels = Panels(len(records), COLUMNS, 1.5, legend=legend, margin=(0.75, 0.5, 0.1), gap=(0.5, 0.85))
    squares = dict.fromkeys((key for key, _, _ in MODELS), 0.0)
    for axes, one in zip(panels.axes, records, strict=True):
        for key, model, colour in MODELS:
            residual = np.asarray(one["measured"]) - np.asarray(one[key])
            squares[key] += float(np.sum(residual**2))
            (line,) = axes.plot(np.asarray(one["time"]), unit.factor * residual, color=colour, lw=1.0)
            keyed(line, model=model)
        panel_of(axes, one["test"])
        axes.set_xlabel("time (s)", labelpad=1)
    panels.label(y=unit.label("residual"))
    left = whole_percent(squares["after"] / squares["before"]) if squares["before"] else "–"
    return panels.figure(
        "Measured minus simulated over time, before and after",
        "Measured minus simulated in the last period of each test (or at its end), noise included.",
        good="the blue line is noise.",
        bad="the blue line follows the input.",
        finding=f"With the best model {left} of the squared residual is left, noise included.",
    )
