"""Points by name, posterior draws and fireflies: where they lie, and the signals that the model gives at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.overlay import Overlay
from mofit.report.run import Mode, Run, labels, numbers
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import MODE_COLOURS, Panels, dot_key
from mofit.report.toolkit.formatting import Unit, parameter_label
from mofit.results import predictive_places

COLOURS = {"draw": MODE_COLOURS[3], "firefly": MODE_COLOURS[4]}
"""Colour of what belongs to the chosen one, by its kind."""

_FEW = 12
"""Draws that can be chosen: each has a curve per test and figure."""
_DENSE = 300
"""Samples of such a curve."""


@dataclass(frozen=True)
class Points:
    """Points of one kind that a page names: their rows among those with signals, and their parameters in SI units."""

    kind: str
    names: list[str]
    rows: list[int]
    values: FloatArray

    @property
    def colour(self) -> str:
        """Colour of what belongs to a chosen one."""
        return COLOURS[self.kind]

    def signals(self, overlay: Overlay) -> FloatArray:
        """The output at every one of the kind, shape (rows, samples); (0, 0) where the run has none."""
        return overlay.draws if self.kind == "draw" else overlay.fireflies


def extract_draws(mode: Mode) -> Points | None:
    """Some of the draws that the run simulated, evenly spread; None where it simulated none."""
    node = mode.node.children.get("posterior_predictive")
    if node is None or not mode.sampled:
        return None
    places = predictive_places(mode.draws.shape[:2], (node.sizes["chain"], node.sizes["draw"]))
    predicted = mode.draws[places].reshape(-1, len(mode.parameters))
    rows = np.linspace(0, len(predicted) - 1, min(_FEW, len(predicted))).astype(int)
    return Points("draw", [str(k + 1) for k in range(len(rows))], rows.tolist(), predicted[rows])


def extract_fireflies(run: Run) -> Points | None:
    """The fireflies that the run simulated, best first; None where it simulated none."""
    node = run.group("fireflies")
    if node is None:
        return None
    names = labels(node, "firefly")
    return Points("firefly", names, [*range(len(names))], numbers(node, "value"))


def curves_on_request(
    panels: Panels,
    axes: Axes,
    offered: Sequence[Points],
    overlay: Overlay,
    x: FloatArray,
    unit: Unit,
    less: float | FloatArray = 0.0,
) -> None:
    """The output at every point (less something), which the page shows once the point is chosen."""
    every = max(1, x.size // _DENSE)
    for points in offered:
        signals = points.signals(overlay)
        if not signals.size:
            continue
        for name, row in zip(points.names, points.rows, strict=True):
            y = unit.factor * (signals[row] - less)
            label = f"{points.kind} {name}"
            panels.on_request(axes, label, x[::every], y[::every], points.colour, **{points.kind: name})


def draws_figure(run: Run, mode: Mode, draws: Points) -> Figure:
    """A panel per two parameters with the draws as dots; a click on one shows its curves."""
    d = len(mode.parameters)
    units = [run.unit(name) for name in mode.parameters]
    chosen = [(k, min(k + 1, d - 1)) for k in range(0, d, 2)]
    panels = Panels(len(chosen), 4, 1.7, legend=[dot_key(draws.colour, "a draw")], gap=(0.85, 0.75))
    for (x, y), axes in zip(chosen, panels.axes, strict=True):
        (dots,) = axes.plot(*draws.values[:, [x, y]].T, color=draws.colour, ls="none", marker="o", ms=5, label="a draw")
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
