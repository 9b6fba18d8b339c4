"""A few posterior draws by name: their parameters to choose from, and the signals that the model gives at them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.overlay import Overlay
from mofit.report.run import Mode, Run
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import MODE_COLOURS, Panels, dot_key
from mofit.report.toolkit.formatting import Unit, parameter_label
from mofit.results import predictive_places

DRAWN = MODE_COLOURS[3]
"""Colour of what belongs to the chosen draw."""

_FEW = 12
"""Draws that can be chosen: each has a curve per test and figure."""
_DENSE = 300
"""Samples of such a curve."""


@dataclass(frozen=True)
class Draws:
    """Draws of one mode that a page names: their rows among the predicted ones, and their parameters in SI units."""

    names: list[str]
    rows: list[int]
    values: FloatArray


def extract_draws(mode: Mode) -> Draws | None:
    """Some of the draws that the run simulated, evenly spread; None where it simulated none."""
    node = mode.node.children.get("posterior_predictive")
    if node is None or not mode.sampled:
        return None
    places = predictive_places(mode.draws.shape[:2], (node.sizes["chain"], node.sizes["draw"]))
    predicted = mode.draws[places].reshape(-1, len(mode.parameters))
    rows = np.linspace(0, len(predicted) - 1, min(_FEW, len(predicted))).astype(int)
    return Draws([str(k + 1) for k in range(len(rows))], rows.tolist(), predicted[rows])


def curves_on_request(
    panels: Panels,
    axes: Axes,
    draws: Draws | None,
    overlay: Overlay,
    x: FloatArray,
    unit: Unit,
    less: float | FloatArray = 0.0,
) -> None:
    """The output at every draw (less something), which the page shows once the draw is chosen."""
    if draws is None or not overlay.draws.size:
        return
    every = max(1, x.size // _DENSE)
    for name, row in zip(draws.names, draws.rows, strict=True):
        y = unit.factor * (overlay.draws[row] - less)
        panels.on_request(axes, f"draw {name}", x[::every], y[::every], DRAWN, draw=name)


def draws_figure(run: Run, mode: Mode, draws: Draws) -> Figure:
    """A panel per two parameters with the draws as dots; a click on one shows its curves."""
    d = len(mode.parameters)
    units = [run.unit(name) for name in mode.parameters]
    chosen = [(k, min(k + 1, d - 1)) for k in range(0, d, 2)]
    panels = Panels(len(chosen), 4, 1.7, legend=[dot_key(DRAWN, "a draw")], gap=(0.85, 0.75))
    for (x, y), axes in zip(chosen, panels.axes, strict=True):
        (dots,) = axes.plot(*draws.values[:, [x, y]].T, color=DRAWN, ls="none", marker="o", ms=5, label="a draw")
        keyed(dots, draw=draws.names)
        axes.set_xlabel(parameter_label(mode.parameters[x], units[x]))
        axes.set_ylabel(parameter_label(mode.parameters[y], units[y]))
        few_ticks(axes, 3, 4)
    return panels.figure(
        "Posterior draws over pairs of parameters",
        "Draws from the posterior. Choose one, here or at the top of the page: the figures above show the signals that "
        "the model gives at it.",
        good="the curve of any draw is hardly to be told from the best one's.",
        bad="draws whose curves differ visibly: the data allow them all.",
        finding=f"{len(draws.names)} draws of mode {mode.name}, each of which leads to its signals in every test.",
    )
