"""How far the gap shrinks: errors per test, loops and residuals, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mofit.report.toolkit.axes import axis_of_tests
from mofit.report.toolkit.blocks import Block, Figure, Section, tabs
from mofit.report.toolkit.figures import BASELINE, FLOOR, MEASURED, Panels, band_key, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import Unit, display_unit

#: Panels in a row, and most records that are drawn.
_COLUMNS, _MOST = 4, 16
_LAYOUT: Any = {"margin": (0.75, 0.5, 0.1), "gap": (0.5, 0.85)}


def shrinkage_section(data: Mapping[str, Any]) -> Section:
    """NRMSD per test; output over input, and residual over time."""
    records = data["records"][:_MOST]
    unit = display_unit(records[0]["output_unit"], np.concatenate([one["measured"] for one in records]))
    periodic = [one for one in records if one["frequency"] is not None]
    panes: dict[str, list[Block]] = {"Loops": [_loops(periodic, unit)]} if periodic else {}
    panes["Residuals"] = [_residuals(records, display_unit(records[0]["output_unit"], 0.0))]
    blocks: list[Block] = [_errors(data), *tabs(panes)]
    keys = ("nrmsd_before", "nrmsd_after", "noise_floor", "shrinkage", "records")
    return Section("shrinkage", "How far it shrinks", blocks, {key: data[key] for key in keys})


def _errors(data: Mapping[str, Any]) -> Figure:
    tests = list(data["nrmsd_before"])
    legend = [band_key(BASELINE, "without effects", 1.0), band_key(mode_colour(0), "with the best model", 1.0)]
    panels = Panels(1, 1, 1.9, legend=[*legend, line_key(FLOOR, "noise floor")], margin=(0.75, 0.75, 0.1))
    axes = panels.axes[0]
    x = axis_of_tests(axes, tests)
    for offset, key, colour in ((-0.2, "nrmsd_before", BASELINE), (0.2, "nrmsd_after", mode_colour(0))):
        axes.bar(x + offset, [100 * data[key][test] for test in tests], 0.38, color=colour)
    floors = [100 * data["noise_floor"][test] for test in tests]
    axes.hlines(floors, x - 0.42, x + 0.42, color=FLOOR, lw=1.6)
    panels.label(y="NRMSD (%)")
    return panels.figure(
        "NRMSD per test before and after",
        "Error per test without effects and with the best model, fitted to all tests. An error near the noise floor "
        "can still hide a gap: the gap repeats, the noise does not.",
        good="blue equals the noise floor in every test.",
        bad="blue is well above it somewhere.",
    )


def _loops(records: Sequence[Mapping[str, Any]], unit: Unit) -> Figure:
    legend = [
        dot_key(MEASURED, "measured", marker="."),
        line_key(BASELINE, "without effects", ls="--"),
        line_key(mode_colour(0), "with the best model"),
    ]
    panels = Panels(len(records), _COLUMNS, 1.75, legend=legend, **_LAYOUT)
    for axes, one in zip(panels.axes, records, strict=True):
        x = display_unit(one["input_unit"], one["input"])
        values = x.factor * np.asarray(one["input"])
        axes.plot(values, unit.factor * np.asarray(one["measured"]), color=MEASURED, ls="none", marker=".", ms=3.2)
        axes.plot(values, unit.factor * np.asarray(one["before"]), color=BASELINE, ls="--", lw=1.2)
        axes.plot(values, unit.factor * np.asarray(one["after"]), color=mode_colour(0), lw=1.4)
        axes.set_title(one["test"])
        axes.set_xlabel(x.label(one["input_name"]), labelpad=1)
    panels.label(y=unit.label(records[0]["output_name"]))
    return panels.figure(
        "Loops of output over input, measured and simulated, before and after",
        "Output over input in the last period of each test.",
        good="the blue line runs through the middle of the measured points.",
        bad="the blue line is no better than the dashed one.",
    )


def _residuals(records: Sequence[Mapping[str, Any]], unit: Unit) -> Figure:
    legend = [line_key(BASELINE, "without effects"), line_key(mode_colour(0), "with the best model")]
    panels = Panels(len(records), _COLUMNS, 1.5, legend=legend, **_LAYOUT)
    for axes, one in zip(panels.axes, records, strict=True):
        for key, colour in (("before", BASELINE), ("after", mode_colour(0))):
            residual = np.asarray(one["measured"]) - np.asarray(one[key])
            axes.plot(np.asarray(one["time"]), unit.factor * residual, color=colour, lw=1.0)
        axes.set_title(one["test"])
        axes.set_xlabel("time (s)", labelpad=1)
    panels.label(y=unit.label("residual"))
    return panels.figure(
        "Measured minus simulated over time, before and after",
        "Measured minus simulated in the last period of each test (or at its end), noise included.",
        good="the blue line is noise.",
        bad="the blue line follows the input.",
    )
