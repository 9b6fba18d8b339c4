"""All solutions together, each with its weight: what is known of a parameter if one does not choose."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import compact, math_symbol, number, symbol, with_sd
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.run import Array, Run, labels, numbers, tab_title
from mofit.report.style import cluster_colour, few_ticks, image_of, legend_above, line_key, panels

_BINS = 60


def mixture_section(run: Run) -> Section | None:
    """Table and figure; None where the run has one solution only."""
    node = run.group("mixture")
    if node is None:
        return None
    names = labels(node, "parameter")
    columns = {name: numbers(node, name) for name in ("mean", "sd", "q05", "q50", "q95")}
    rows = []
    for k, name in enumerate(names):
        mean, sd, low, _, high = (float(column[k]) for column in columns.values())
        unit = run.unit(name)
        interval = f"{with_sd(low, sd)} … {with_sd(high, sd)}"
        rows.append([symbol(name), f"{with_sd(mean, sd)} ± {number(sd, 2)}", interval, "" if unit == "1" else unit])
    blocks: list[Block] = [
        Text(
            "Until a test tells the solutions apart, each counts by its weight. An interval below may span a gap "
            "between them in which nothing is plausible: look at the figure."
        ),
        Table(["Parameter", "Mean ± sd", "90 % interval", "Unit"], rows, "All solutions together.", left=[3]),
        _figure(run, names),
    ]
    return Section("mixture", "All solutions together", blocks, {"parameter": names, **columns})


def _figure(run: Run, names: list[str]) -> Figure:
    node = run.tree["mixture"].children
    solution = numbers(node["sample_stats"], "solution").ravel().astype(int) - 1
    canvas, axes, _ = panels(len(names), 4, 1.5, margin=(0.3, 0.4, 0.3, 0.75), gap=(0.35, 0.65))
    for name, panel in zip(names, axes, strict=True):
        unit = run.unit(name)
        values = numbers(node["posterior"], name).ravel()
        _draw(values, solution, len(run.clusters), bool(run.is_log([name])[0]), panel)
        panel.set_title(math_symbol(name) + ("" if unit == "1" else f"  ({unit})"))
    legend_above(canvas, [line_key(cluster_colour(c.index), tab_title(c), lw=6) for c in run.clusters])
    return Figure(
        image_of(canvas),
        "Posterior of each parameter, stacked by solution",
        "Posterior of each parameter with the solutions stacked on each other.",
        good="one hump: the solutions agree on this parameter.",
        bad="humps apart in different colours: which value is right depends on the solution.",
    )


def _draw(values: Array, solution: Array, solutions: int, log: bool, axes: Axes) -> None:
    low, high = np.quantile(values, [0.0005, 0.9995])
    edges = np.geomspace(low, high, _BINS + 1) if log else np.linspace(low, high, _BINS + 1)
    below = np.zeros(_BINS)
    for k in range(solutions):
        above = below + np.histogram(values[solution == k], edges)[0]
        axes.stairs(above, edges, baseline=below, fill=True, color=cluster_colour(k))
        below = above
    axes.set_yticks([])
    few_ticks(axes, 3, None)
    axes.xaxis.set_major_formatter(lambda value, _: compact(value))
    axes.spines["left"].set_visible(False)
