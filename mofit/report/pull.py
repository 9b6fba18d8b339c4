"""Which test pulls which parameter where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import math_symbol, percent
from mofit.report.page import Figure
from mofit.report.run import Array, Run, labels, numbers
from mofit.report.style import image_of, panels

#: A test pulls if a standard deviation more of the parameter changes its error by this share.
NOTABLE = 0.005


@dataclass(frozen=True)
class Pull:
    """Relative change of each test's NRMSD per standard deviation of each parameter, shape (test, parameter)."""

    tests: list[str]
    parameters: list[str]
    change: Array


def extract_pull(run: Run) -> Pull | None:
    """Of the best solution, or None where the run has none."""
    best = run.clusters[0]
    if "pull" not in best.node.data_vars:
        return None
    return Pull(labels(best.node, "test"), best.parameters, numbers(best.node, "pull"))


def draw_pull(pull: Pull, axes: Axes) -> Axes:
    """Tests over parameters; purple: the test wants more of the parameter, orange: less."""
    limit = max(float(np.nanmax(np.abs(pull.change))), NOTABLE)
    axes.imshow(-pull.change.T, cmap="PuOr", vmin=-limit, vmax=limit, aspect="auto")
    for (t, k), change in np.ndenumerate(pull.change):
        if np.isfinite(change) and abs(change) >= NOTABLE:
            arrow = "↑" if change < 0 else "↓"
            colour = "white" if abs(change) > 0.6 * limit else "#1d2329"
            axes.text(t, k, f"{arrow} {percent(abs(change))}", ha="center", va="center", fontsize=7.5, color=colour)
    axes.set_xticks(np.arange(len(pull.tests)), pull.tests, rotation=35 if len(pull.tests) > 10 else 0)
    axes.set_yticks(np.arange(len(pull.parameters)), [math_symbol(name) for name in pull.parameters])
    axes.grid(visible=False)
    axes.tick_params(length=0)
    return axes


def pull_figure(run: Run, pull: Pull) -> Figure:
    """Heat map with a cell per test and parameter."""
    height = 0.3 * len(pull.parameters) + 0.2
    canvas, axes, _ = panels(1, 1, height, margin=(0.75, 0.45, 0.15, 0.15))
    draw_pull(pull, axes[0])
    return Figure(
        image_of(canvas),
        "How each test's error changes with each parameter at the joint minimum",
        f"At {run.clusters[0].name}: what one standard deviation more (↓: less would be better) or less (↑: more would "
        "be better) of a parameter is worth to a test, as a share of its error. Cells without a number: under "
        f"{percent(NOTABLE)}.",
        good="small numbers without a pattern: the tests agree on the parameter.",
        bad="one end of the frequency range pulls up and the other down: the joint value is a compromise; the model "
        "lacks what changes between them.",
    )
