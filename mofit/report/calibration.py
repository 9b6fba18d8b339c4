"""The stages before the search: steady-state curve and static spring (Hackl et al. 2016, Figures 7 and 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mofit.report.display import display_unit, number, percent, symbol, with_sd
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.run import Array, Run, labels, numbers
from mofit.report.style import MEASURED, cluster_colour, few_ticks, image_of, legend_above, line_key, panels


@dataclass(frozen=True)
class Stage:
    """One calibration stage, SI units."""

    name: str
    model: str
    tests: str
    parameters: list[str]
    value: Array
    sd: Array
    x: Array
    measured: Array
    fitted: Array
    x_label: tuple[str, str]
    y_label: tuple[str, str]
    nrmsd: float


def extract_stages(run: Run) -> list[Stage]:
    """All stages in the order of the tree."""
    node = run.group("calibration")
    return [] if node is None else [_stage(name, child) for name, child in node.children.items()]


def _stage(name: str, node: xr.DataTree) -> Stage:
    arrays = {key: numbers(node, key) for key in ("value", "sd", "x", "measured", "fitted")}
    attrs = {key: node.dataset[key].attrs for key in ("x", "measured")}
    return Stage(
        name=name,
        model=str(node.attrs["model"]),
        tests=str(node.attrs["tests"]),
        parameters=labels(node, f"parameter_{name}"),
        **arrays,
        x_label=(str(attrs["x"]["long_name"]), str(attrs["x"]["units"])),
        y_label=(str(attrs["measured"]["long_name"]), str(attrs["measured"]["units"])),
        nrmsd=float(numbers(node, "nrmsd")),
    )


def draw_stage(stage: Stage, axes: Axes, residual: Axes) -> Axes:
    """Measured points and the fitted curve over the input, and what is left over below."""
    order = np.argsort(stage.x, kind="stable")
    x_unit, y_unit = display_unit(stage.x_label[1], stage.x), display_unit(stage.y_label[1], stage.measured)
    x = x_unit.factor * stage.x[order]
    measured, fitted = y_unit.factor * stage.measured[order], y_unit.factor * stage.fitted[order]
    few = stage.x.size <= 40
    dots: dict[str, Any] = {
        "ls": "none",
        "marker": "o" if few else ".",
        "ms": 6 if few else 2.5,
        "rasterized": stage.x.size > 800,
    }
    axes.plot(x, measured, color=MEASURED, mfc="white" if few else MEASURED, **dots)
    axes.plot(x, fitted, color=cluster_colour(0), lw=1.8)
    left_over = measured - fitted
    small = display_unit(stage.y_label[1], left_over / y_unit.factor)
    left_over = left_over / y_unit.factor * small.factor
    residual.plot(x, left_over, color=cluster_colour(0), **dots)
    residual.axhline(0, color=MEASURED, lw=0.6)
    axes.set_ylabel(y_unit.label(stage.y_label[0].replace("_", " ")))
    residual.set_ylabel(small.label("residual"))
    residual.set_xlabel(x_unit.label(stage.x_label[0].replace("_", " ")))
    axes.set_title(f"{stage.name.replace('_', ' ')}: {stage.model}")
    few_ticks(axes, 6, 5)
    residual.margins(y=0.2)
    few_ticks(residual, None, 3)
    return axes


def calibration_section(run: Run) -> Section | None:
    """Curves and values of the stages."""
    stages = extract_stages(run)
    if not stages:
        return None
    canvas, axes, below = panels(len(stages), 2, 2.4, lower=0.75, margin=(0.75, 0.55, 0.15, 0.65), gap=(0.9, 0.8))
    for stage, panel, residual in zip(stages, axes, below, strict=True):
        draw_stage(stage, panel, residual)
    legend_above(
        canvas,
        [line_key(MEASURED, "measured", ls="none", marker="o", mfc="white"), line_key(cluster_colour(0), "fitted")],
    )
    blocks: list[Block] = [
        Text(
            "Found before the search from tests made for them; their uncertainty is carried into the main "
            "identification."
        ),
        Figure(
            image_of(canvas),
            "Calibration stages: measured points and fitted curves",
            "Each stage with its fitted curve, and below it the residual.",
            good="the residual scatters around zero without a shape.",
            bad="the residual bends: the curve's form doesn't suit this specimen over the whole range.",
        ),
        _table(run, stages),
    ]
    return Section("calibration", "Calibration stages", blocks, {"stages": stages})


def _table(run: Run, stages: list[Stage]) -> Table:
    rows = []
    for stage in stages:
        for k, name in enumerate(stage.parameters):
            unit = run.unit(name) if name in run.parameters else ""
            first = [stage.name.replace("_", " "), stage.tests, percent(stage.nrmsd)] if k == 0 else ["", "", ""]
            value, sd = float(stage.value[k]), float(stage.sd[k])
            rows.append([*first, symbol(name), with_sd(value, sd), number(sd, 2), "" if unit == "1" else unit])
    return Table(["Stage", "Tests", "NRMSD", "Parameter", "Value", "sd", "Unit"], rows, left=[1, 6])
