"""The stages before the search: steady-state curve and static spring (Hackl et al. 2016, Figures 7 and 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Column, Section, Table, Text, parameter_column, unit_column, words
from mofit.report.toolkit.figures import MEASURED, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import display_unit, number, percent, with_sd


@dataclass(frozen=True)
class Stage:
    """One calibration stage, SI units; labels are quantity and unit."""

    name: str
    model: str
    tests: str
    parameters: list[str]
    value: FloatArray
    sd: FloatArray
    x: FloatArray
    measured: FloatArray
    fitted: FloatArray
    x_label: tuple[str, str]
    y_label: tuple[str, str]
    nrmsd: float


def extract_stages(run: Run) -> list[Stage]:
    """All stages in the order of the tree."""
    node = run.group("calibration")
    return [] if node is None else [_stage(name, child) for name, child in node.children.items()]


def calibrated(run: Run) -> dict[str, tuple[float, float]]:
    """Estimate and standard deviation that calibration stages alone gave, by parameter."""
    return {
        name: (float(value), float(sd))
        for stage in extract_stages(run)
        for name, value, sd in zip(stage.parameters, stage.value, stage.sd, strict=True)
    }


def _stage(name: str, node: xr.DataTree) -> Stage:
    def label(key: str) -> tuple[str, str]:
        attrs = node.dataset[key].attrs
        return str(attrs["long_name"]).replace("_", " "), str(attrs["units"])

    return Stage(
        name=name.replace("_", " "),
        model=str(node.attrs["model"]),
        tests=str(node.attrs["tests"]),
        parameters=labels(node, f"parameter_{name}"),
        **{key: numbers(node, key) for key in ("value", "sd", "x", "measured", "fitted")},
        x_label=label("x"),
        y_label=label("measured"),
        nrmsd=float(numbers(node, "nrmsd")),
    )


def draw_stage(stage: Stage, axes: Axes, below: Axes) -> Axes:
    """Measured points and the fitted curve over the input, and the residual below."""
    order = np.argsort(stage.x, kind="stable")
    residual = (stage.measured - stage.fitted)[order]
    x_unit, y_unit = display_unit(stage.x_label[1], stage.x), display_unit(stage.y_label[1], stage.measured)
    small = display_unit(stage.y_label[1], residual)
    x = x_unit.factor * stage.x[order]
    few = stage.x.size <= 40
    dots: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 6} if few else {"ls": "none", "marker": ".", "ms": 2.5}
    dots["rasterized"] = stage.x.size > 800
    measured = y_unit.factor * stage.measured[order]
    axes.plot(x, measured, color=MEASURED, mfc="white" if few else MEASURED, **dots)
    axes.plot(x, y_unit.factor * stage.fitted[order], color=mode_colour(0), lw=1.8)
    below.plot(x, small.factor * residual, color=mode_colour(0), **dots)
    below.axhline(0, color=MEASURED, lw=0.6)
    axes.set_ylabel(y_unit.label(stage.y_label[0]))
    below.set_ylabel(small.label("residual"))
    below.set_xlabel(x_unit.label(stage.x_label[0]))
    axes.set_title(f"{stage.name}: {stage.model}")
    few_ticks(axes, 6, 5)
    below.margins(y=0.2)
    few_ticks(below, None, 3)
    return axes


def calibration_section(run: Run) -> Section | None:
    """Curves and values of the stages."""
    stages = extract_stages(run)
    if not stages:
        return None
    legend = [dot_key(MEASURED, "measured", hollow=True), line_key(mode_colour(0), "fitted")]
    panels = Panels(len(stages), 2, 2.4, legend=legend, lower=0.75, margin=(0.75, 0.55, 0.15), gap=(0.9, 0.8))
    for stage, axes, below in zip(stages, panels.axes, panels.lower, strict=True):
        draw_stage(stage, axes, below)
    figure = panels.figure(
        "Calibration stages: measured points and fitted curves",
        "Each stage with its fitted curve. Below: the residual.",
        good="the residual scatters around zero without a shape.",
        bad="the residual bends: the form of the curve does not suit this specimen over the whole range.",
        finding="; ".join(f"{stage.name} leaves {percent(stage.nrmsd)} of the range" for stage in stages).capitalize()
        + ".",
    )
    text = Text(
        "These stages estimate some parameters before the search, each from tests made for it. The posterior of the "
        "main identification includes their uncertainty."
    )
    return Section("calibration", "Calibration stages", [text, figure, _table(run, stages)], {"stages": stages})


def _table(run: Run, stages: list[Stage]) -> Table:
    rows = [(stage, k, name) for stage in stages for k, name in enumerate(stage.parameters)]

    def once(text: str) -> list[str]:
        return [getattr(stage, text) if k == 0 else "" for stage, k, _ in rows]

    return Table(
        [
            Column("Stage", once("name")),
            words("Tests", once("tests")),
            Column("NRMSD", [percent(stage.nrmsd) if k == 0 else "" for stage, k, _ in rows]),
            parameter_column(name for _, _, name in rows),
            Column("Value", [with_sd(float(stage.value[k]), float(stage.sd[k])) for stage, k, _ in rows]),
            Column("sd", [number(float(stage.sd[k]), 2) for stage, k, _ in rows]),
            unit_column(run.unit(name) for _, _, name in rows),
        ]
    )
