"""How the search got on: the best point and the dominated volume over its evaluations."""

from __future__ import annotations

from dataclasses import dataclass

from mofit.report.page import Figure
from mofit.report.run import Array, Run, numbers
from mofit.report.style import MEASURED, few_ticks, image_of, panels


@dataclass(frozen=True)
class Growth:
    """Evaluations, least mean NRMSD and hypervolume by then."""

    evaluations: Array
    best: Array
    hypervolume: Array


def extract_growth(run: Run) -> Growth | None:
    """The record of the search, or None where the run has none."""
    node = run.group("search")
    if node is None or "hypervolume" not in node.data_vars:
        return None
    return Growth(numbers(node, "checkpoint"), numbers(node, "best"), numbers(node, "hypervolume"))


def growth_figure(growth: Growth) -> Figure:
    """Two curves over the number of evaluations."""
    canvas, axes, _ = panels(2, 3, 1.8, margin=(0.75, 0.5, 0.15, 0.2), gap=(0.85, 0.0))
    for panel, values, label in (
        (axes[0], 100 * growth.best, "least mean NRMSD (%)"),
        (axes[1], growth.hypervolume, "hypervolume"),
    ):
        panel.plot(growth.evaluations, values, color=MEASURED, marker="o", ms=3.5)
        panel.set_xlabel("evaluations")
        panel.set_ylabel(label)
        few_ticks(panel)
    axes[1].set_ylim(0, 1.02)
    return Figure(
        image_of(canvas),
        "Best point and hypervolume of the front over the evaluations of the search",
        "Left the best point so far. Right the share of the box between the best and the median of every objective "
        "that some point dominates: it grows as long as the front gains ground.",
        good="both curves are flat at the end: more evaluations would find nothing new.",
        bad="they still move at the end: the search deserves a larger budget.",
    )
