"""Leverage: which test changes which parameter, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.axes import heat_map
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.figures import MEASURED, Panels
from mofit.report.toolkit.formatting import math_symbol, percent

NOTABLE = 0.005
"""Change of a test's error, by a standard deviation of the parameter, that is written into its cell."""


@dataclass(frozen=True)
class Leverage:
    """Relative change of each test's NRMSD per standard deviation of each parameter, shape (test, parameter)."""

    tests: list[str]
    parameters: list[str]
    change: FloatArray


def extract_leverage(run: Run) -> Leverage | None:
    """Of the best mode, or None where the run has none."""
    best = run.best
    if "leverage" not in best.node.data_vars:
        return None
    return Leverage(labels(best.node, "test"), best.parameters, numbers(best.node, "leverage"))


def draw_leverage(found: Leverage, axes: Axes) -> Axes:
    """Tests over parameters; purple: the test prefers more of the parameter, orange: less."""
    limit = max(float(np.nanmax(np.abs(found.change))), NOTABLE)
    symbols = [math_symbol(name) for name in found.parameters]
    heat_map(axes, -found.change.T, symbols, found.tests, cmap="PuOr", vmin=-limit, vmax=limit)
    axes.tick_params(axis="x", rotation=35 if len(found.tests) > 10 else 0)
    for (t, k), change in np.ndenumerate(found.change):
        if np.isfinite(change) and abs(change) >= NOTABLE:
            text = f"{'↑' if change < 0 else '↓'} {percent(abs(change))}"
            colour = "white" if abs(change) > 0.6 * limit else MEASURED
            axes.text(t, k, text, ha="center", va="center", fontsize=7.5, color=colour)
    return axes


def leverage_figure(run: Run, found: Leverage) -> Figure:
    """Heat map with a cell per test and parameter."""
    panels = Panels(1, 1, 0.3 * len(found.parameters) + 0.2, margin=(0.75, 0.45, 0.15), top=0.15)
    draw_leverage(found, panels.axes[0])
    return panels.figure(
        "How the error of each test changes with each parameter at the joint estimate",
        f"Leverage at {run.best.name}: by which share the error of a test falls with one standard deviation more (↑) "
        f"or less (↓) of a parameter. Cells without a number: under {percent(NOTABLE)}.",
        good="small numbers without a pattern: the tests agree on the parameter.",
        bad="one end of the frequency range prefers more, the other less: the joint value is a compromise; the model "
        "lacks what changes between them.",
    )
