"""Correlation of the parameters: maps, variance inflation, condition indices, unidentifiable directions."""

from __future__ import annotations

import numpy as np

from mofit.design.comparison_result import Comparison, ExperimentResult
from mofit.report.directions import direction_texts, principal_directions
from mofit.report.toolkit.axes import heat_map
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, Text
from mofit.report.toolkit.figures import Panels
from mofit.report.toolkit.formatting import listed, math_symbol, number, symbol

#: Experiments whose maps are drawn.
_DRAWN = 12
#: Condition index above which parameters are strongly collinear (Belsley).
_STRONG = 30.0


def correlation_section(comparison: Comparison) -> Section:
    """Maps and tables for all experiments, unidentifiable directions of those that are drawn."""
    rows = comparison.experiments
    columns = [
        Column("Experiment", [row.experiment.name for row in rows]),
        Column("Condition index", [number(row.condition_index, 3) for row in rows]),
    ]
    for name in comparison.parameters:
        columns.append(Column(symbol(name), [number(row.parameters[name].variance_inflation, 3) for row in rows]))
    table = Table(
        columns,
        f"Largest condition index of the parameters that no calibration stage estimates (above {_STRONG:g}: strongly "
        "collinear), and variance inflation factors: the variance of a parameter over that with all others known.",
    )
    blocks: list[Block] = [_maps(comparison), table]
    for row in _drawn(comparison):
        known = comparison.sources[row.experiment.source]
        for text in direction_texts(principal_directions(known.source.space, row.covariance, known.samples[0])):
            blocks.append(Text(listed([row.experiment.name]) + ": " + text))
    return Section("correlation", "Correlation of the parameters", blocks)


def _drawn(comparison: Comparison) -> list[ExperimentResult]:
    return [row for row in comparison.experiments if np.isfinite(row.covariance).all()][:_DRAWN]


def _maps(comparison: Comparison) -> Figure:
    drawn = _drawn(comparison)
    names = [math_symbol(name) for name in comparison.sources[0].source.space.names]
    panels = Panels(len(drawn), 4, 2.0, gap=(0.55, 0.75), margin=(0.65, 0.5, 0.9))
    image = None
    for axes, row in zip(panels.axes, drawn, strict=True):
        size = np.sqrt(np.diag(row.covariance))
        scaled = row.covariance / np.outer(size, size)
        image = heat_map(axes, scaled, names, names, turned=True, cmap="RdBu_r", vmin=-1, vmax=1)
        axes.set_title(row.experiment.name)
    if image is not None:
        panels.canvas.colorbar(image, cax=panels.canvas.add_axes((0.945, 0.25, 0.012, 0.5)))
    return panels.figure(
        "correlation maps",
        "Correlation of the estimates of all parameters, calibrated ones included, in each experiment.",
        good="pale off the diagonal.",
        bad="dark: a change of one parameter compensates for a change of another.",
    )
