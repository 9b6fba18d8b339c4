"""How far the gap shrinks: errors per test, loops and traces, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit.report.display import Unit, display_unit
from mofit.report.page import Block, Figure, Section, tabs
from mofit.report.style import BASELINE, FLOOR, MEASURED, cluster_colour, image_of, legend_above, line_key, panels

_COLUMNS, _MOST = 4, 16


def before_after_section(data: Mapping[str, Any]) -> Section:
    """NRMSD per test; measured and simulated over the input, and what is left over time."""
    series = data["series"][:_MOST]
    unit = display_unit(series[0]["output_unit"], np.concatenate([one["measured"] for one in series]))
    looped = [one for one in series if one["frequency"] is not None]
    panes: dict[str, list[Block]] = {"What is left": [_traces(series, display_unit(series[0]["output_unit"], 0.0))]}
    if looped:
        panes = {"Loops": [_loops(looped, unit)], **panes}
    blocks: list[Block] = [_errors(data), *tabs(panes)]
    keys = ("nrmsd_before", "nrmsd_after", "noise_floor", "shrinkage", "series")
    return Section("shrinkage", "How far it shrinks", blocks, {key: data[key] for key in keys})


def _errors(data: Mapping[str, Any]) -> Figure:
    tests = list(data["nrmsd_before"])
    place = np.arange(len(tests))
    canvas, (axes,), _ = panels(1, 1, 1.9, margin=(0.75, 0.75, 0.1, 0.45))
    for offset, key, colour in ((-0.2, "nrmsd_before", BASELINE), (0.2, "nrmsd_after", cluster_colour(0))):
        axes.bar(place + offset, [100 * data[key][test] for test in tests], 0.38, color=colour)
    for k, test in enumerate(tests):
        axes.plot([k - 0.42, k + 0.42], [100 * data["noise_floor"][test]] * 2, color=FLOOR, lw=1.6)
    axes.set_xticks(place, tests, rotation=20, ha="right")
    axes.set_ylabel("NRMSD (%)")
    axes.grid(axis="x", visible=False)
    handles = [
        line_key(BASELINE, "without effects", lw=6),
        line_key(cluster_colour(0), "with the best explanation", lw=6),
    ]
    legend_above(canvas, [*handles, line_key(FLOOR, "noise floor")])
    return Figure(
        image_of(canvas),
        "NRMSD per test before and after",
        "Error per test without effects and with the best explanation, fitted to all tests. An error near the noise "
        "floor can still hide a gap, which repeats while noise does not.",
        good="blue stands on the noise floor in every test.",
        bad="blue is well above it somewhere.",
    )


def _loops(series: list[Mapping[str, Any]], unit: Unit) -> Figure:
    canvas, axes, _ = panels(len(series), _COLUMNS, 1.75, margin=(0.75, 0.5, 0.1, 0.65), gap=(0.5, 0.85))
    for k, (panel, one) in enumerate(zip(axes, series, strict=True)):
        x = display_unit(one["input_unit"], one["input"])
        values = x.factor * np.asarray(one["input"])
        panel.plot(values, unit.factor * np.asarray(one["measured"]), color=MEASURED, ls="none", marker=".", ms=3.2)
        panel.plot(values, unit.factor * np.asarray(one["before"]), color=BASELINE, ls="--", lw=1.2)
        panel.plot(values, unit.factor * np.asarray(one["after"]), color=cluster_colour(0), lw=1.4)
        panel.set_title(one["test"])
        panel.set_xlabel(x.label(one["input_name"]), labelpad=1)
        if k % _COLUMNS == 0:
            panel.set_ylabel(unit.label(one["output_name"]))
    _legend(canvas, "measured")
    return Figure(
        image_of(canvas),
        "Loops of output over input, measured and simulated, before and after",
        "Output over input in the last period of each test.",
        good="the blue line runs through the middle of the measured points.",
        bad="the blue line is no better than the dashed one.",
    )


def _traces(series: list[Mapping[str, Any]], unit: Unit) -> Figure:
    canvas, axes, _ = panels(len(series), _COLUMNS, 1.5, margin=(0.75, 0.5, 0.1, 0.65), gap=(0.5, 0.85))
    for k, (panel, one) in enumerate(zip(axes, series, strict=True)):
        time, measured = np.asarray(one["time"]), np.asarray(one["measured"])
        panel.plot(time, unit.factor * (measured - np.asarray(one["before"])), color=BASELINE, lw=1.0)
        panel.plot(time, unit.factor * (measured - np.asarray(one["after"])), color=cluster_colour(0), lw=1.0)
        panel.set_title(one["test"])
        panel.set_xlabel("time (s)", labelpad=1)
        if k % _COLUMNS == 0:
            panel.set_ylabel(unit.label("left"))
    _legend(canvas, None)
    return Figure(
        image_of(canvas),
        "Measured minus simulated over time, before and after",
        "Measured minus simulated in the last period of each test (or a stretch of the test), noise included.",
        good="the blue line is noise.",
        bad="the blue line swings with the input.",
    )


def _legend(canvas: Any, measured: str | None) -> None:
    handles = [line_key(MEASURED, measured, ls="none", marker=".")] if measured else []
    handles += [
        line_key(BASELINE, "without effects", ls="--"),
        line_key(cluster_colour(0), "with the best explanation"),
    ]
    legend_above(canvas, handles)
