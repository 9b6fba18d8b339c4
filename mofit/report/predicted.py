"""Predicted tests: a table of their errors and of the band's parts, and the band over the measured output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.overlay import headed
from mofit.report.run import Run
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, Text, words, wrapped
from mofit.report.toolkit.figures import MEASURED, Panels, band_key, line_key, mode_colour, panel_of
from mofit.report.toolkit.formatting import Unit, display_unit, number, percent, symbol
from mofit.results import SCOPED_SOURCES, prediction_rows

_DETAIL = 400
"""Samples of the detail around the largest output."""

_MOST = 12
"""Tests that are drawn; the file holds all."""

_DENSE = 800
"""Samples from which a curve is rasterised."""


@dataclass(frozen=True)
class Predicted:
    """An output of a predicted test over time, SI units; nan where it was not measured."""

    name: str
    unit: str
    time: FloatArray
    median: FloatArray
    parameter_low: FloatArray
    parameter_high: FloatArray
    low: FloatArray
    high: FloatArray
    measured: FloatArray

    def detail(self) -> Predicted:
        """The samples around the largest deviation of the median from its mean."""
        n = len(self.time)
        middle = int(np.argmax(np.abs(self.median - self.median.mean())))
        start = min(max(0, middle - _DETAIL // 2), max(0, n - _DETAIL))
        signals = {key: value for key, value in vars(self).items() if isinstance(value, np.ndarray)}
        cut = {key: value[start : start + _DETAIL] for key, value in signals.items()}
        return Predicted(f"{self.name}, detail", self.unit, **cut)


def extract_predicted(node: xr.DataTree) -> dict[str, list[Predicted]]:
    """Predicted tests of every output by its name; that of an only output is empty."""
    found: dict[str, list[Predicted]] = {}
    for test, child in node["tests"].children.items() if "tests" in node.children else ():
        own = child.dataset
        several = "output" in own["median"].dims
        for k, output in enumerate(map(str, own["output"].values) if several else ("",)):
            unit = str(own["output_unit"].values[k]) if several else str(own["median"].attrs["units"])
            signals = {
                name: np.asarray(own[name].values[:, k] if several else own[name].values, dtype=float)
                for name in ("median", "parameter_low", "parameter_high", "low", "high", "measured")
            }
            time = np.asarray(own["time"].values, dtype=float)
            found.setdefault(output, []).append(Predicted(test, unit, time, **signals))
    return found


def draw_band(one: Predicted, unit: Unit, axes: Axes, lower: Axes) -> None:
    """Measured output, median and bands over time; below, all relative to the median."""
    colour, time = mode_colour(0), one.time
    dense: dict[str, Any] = {"rasterized": time.size > _DENSE}
    for panel, base in ((axes, np.zeros_like(time)), (lower, one.median)):
        edges = [unit.factor * (edge - base) for edge in (one.low, one.high, one.parameter_low, one.parameter_high)]
        panel.fill_between(time, edges[0], edges[1], color=colour, alpha=0.22, lw=0, **dense)
        panel.fill_between(time, edges[2], edges[3], color=colour, alpha=0.5, lw=0, **dense)
        panel.plot(time, unit.factor * (one.median - base), color=colour, lw=1.0, **dense)
        if np.isfinite(one.measured).any():
            panel.plot(time, unit.factor * (one.measured - base), color=MEASURED, lw=0.8, **dense)
    panel_of(axes, one.name.removesuffix(", detail"), one.name)
    axes.set_xlim(time[0], time[-1])
    few_ticks(axes)
    few_ticks(lower, None, 2)


def _inside(tests: Sequence[Predicted]) -> str:
    """The share of measured samples within the light band, where it is smallest."""
    shares = {
        one.name: float(np.mean(((one.measured >= one.low) & (one.measured <= one.high))[np.isfinite(one.measured)]))
        for one in tests
        if np.isfinite(one.measured).any()
    }
    if not shares:
        return "Nothing was measured here to compare with."
    worst = min(shares, key=lambda name: shares[name])
    return f"Fewest measured samples lie in the 90 % band in {worst}: {percent(shares[worst])}."


def _figure(tests: Sequence[Predicted], output: str) -> Figure:
    shown = tests[:_MOST]
    unit = display_unit(shown[0].unit, np.concatenate([one.median for one in shown]))
    parts = [part for one in shown for part in ((one, one.detail()) if len(one.time) > _DETAIL else (one,))]
    legend = [
        line_key(MEASURED, "measured"),
        line_key(mode_colour(0), "median of the prediction"),
        band_key(mode_colour(0), "90 % band by the parameters", 0.6),
        band_key(mode_colour(0), "90 % band of a new measurement", 0.25),
    ]
    panels = Panels(len(parts), 2, 1.5, legend=legend, lower=0.6, margin=(0.8, 0.5, 0.1), gap=(0.6, 0.62))
    for part, axes, lower in zip(parts, panels.axes, panels.lower, strict=True):
        draw_band(part, unit, axes, lower)
    panels.label("time (s)", unit.label(output.replace("_", " ") or "output"), f"residual ({unit.name})")
    more = f" The {len(tests) - _MOST} other tests are in the file." if len(tests) > _MOST else ""
    return panels.figure(
        headed("Predicted and measured output over time with the residual, per test", output),
        "Output over time, and the piece around its largest value. Below: measured minus median." + more,
        good="nine of ten measured samples lie in the light band, evenly along the record.",
        bad="the measured output leaves the band for whole stretches: there the model misses something that the "
        "identified tests did not show.",
        finding=_inside(shown),
    )


def predicted_figures(node: xr.DataTree) -> list[Block]:
    """A figure per output; none without tests."""
    return [_figure(tests, output) for output, tests in extract_predicted(node).items()]


def predicted_table(node: xr.DataTree) -> list[Block]:
    """Errors, coverage and parts of the band of every test, and where scoped parameters come from."""
    rows = prediction_rows(node)

    def column(head: str, key: str) -> Column:
        cells = [percent(_nan(row[key])) for row in rows]
        return Column(head, cells)

    def of_unit(head: str, key: str) -> Column:
        units = [display_unit(row["unit"], _nan(row["range"])) for row in rows]
        texts = [
            "–" if row[key] is None else f"{number(unit.factor * row[key])} {'' if unit.name == '1' else unit.name}"
            for row, unit in zip(rows, units, strict=True)
        ]
        return Column(head, texts)

    columns = [words("Test", [row["test"] for row in rows])]
    if any(row["output"] for row in rows):
        columns.append(words("Output", [row["output"].replace("_", " ") for row in rows]))
    if len({row["role"] for row in rows}) > 1:
        columns.append(words("", [row["role"] for row in rows]))
    columns += [
        column("NRMSD", "nrmsd"),
        of_unit("rms error", "rms"),
        column("in the 90 % band", "coverage"),
        of_unit("sd: parameters", "parameter_sd"),
        of_unit("sd: noise", "noise_sd"),
        of_unit("sd: model error", "model_error"),
    ]
    blocks: list[Block] = [Table(columns)]
    if any(row["scoped"] for row in rows):
        own = [(row["test"], name, source) for row in rows for name, source in row["scoped"].items()]
        tests, names, sources = zip(*dict.fromkeys(own), strict=True)
        blocks.append(
            Table(
                [
                    words("Test", tests),
                    words("Parameter", [symbol(name) for name in names]),
                    words("Its value in this test", [wrapped(SCOPED_SOURCES[source]) for source in sources]),
                ],
                "Parameters with a value per test or condition.",
            )
        )
    return blocks


def held_out_section(run: Run) -> Section | None:
    """Tests that were not used in the identification, beside those that were."""
    node = run.group("held_out")
    if node is None:
        return None
    lead = Text(
        "The tests held out had no part in search, sampling or references. They are predicted afterwards with all "
        "modes; the same prediction of the fitted tests stands beside them."
    )
    return Section(
        "held_out", "Tests held out", [lead, *predicted_table(node), *predicted_figures(node)],
        {"tests": prediction_rows(node), "signals": extract_predicted(node)},
    )  # fmt: skip


def _nan(value: float | None) -> float:
    return np.nan if value is None else value
