"""All modes together, each with its probability: the posterior of a parameter over all modes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mofit.report.marginals import Marginal, extract_marginal, parameter_axis
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.blocks import Column, Figure, Section, Table, Text, words
from mofit.report.toolkit.figures import Panels, band_key, mode_colour
from mofit.report.toolkit.formatting import interval, parameter_label, plus_minus, symbol, unit_text


def mixture_section(run: Run) -> Section | None:
    """Table and figure; None where the run has one mode only."""
    node = run.group("mixture")
    if node is None:
        return None
    names = labels(node, "parameter")
    data = {name: numbers(node, name) for name in ("mean", "sd", "q05", "q50", "q95")}
    text = Text(
        "Until a test distinguishes the modes, each counts by its probability. An interval below may span a region "
        "between them that is not plausible: see the figure."
    )
    table = Table(
        [
            Column("Parameter", [symbol(name) for name in names]),
            Column("Mean ± sd", [plus_minus(*row) for row in zip(data["mean"], data["sd"], strict=True)]),
            Column("90 % interval", [interval(*row) for row in zip(data["q05"], data["q95"], data["sd"], strict=True)]),
            words("Unit", [unit_text(run.unit(name)) for name in names]),
        ],
        "All modes together.",
    )
    return Section("mixture", "All modes together", [text, table, _figure(run, names)], {"parameter": names, **data})


def _figure(run: Run, names: list[str]) -> Figure:
    node = run.tree["mixture"].children
    mode_of = numbers(node["sample_stats"], "mode").ravel().astype(int) - 1
    found = [mode for mode in run.modes if (mode_of == mode.index).any()]
    shares = {mode.name: float(np.mean(mode_of == mode.index)) for mode in found}
    legend = [band_key(mode.colour, mode.title, 1.0) for mode in run.modes]
    panels = Panels(len(names), 4, 1.5, legend=legend, margin=(0.3, 0.4, 0.3), gap=(0.35, 0.65))
    for name, axes in zip(names, panels.axes, strict=True):
        values = numbers(node["posterior"], name).ravel()
        marginal = extract_marginal(run.space([name]), {mode.name: values[mode_of == mode.index] for mode in found})
        _draw(marginal, shares, {mode.name: mode_colour(mode.index) for mode in found}, axes)
        axes.set_title(parameter_label(name, run.unit(name)))
    return panels.figure(
        "Posterior of each parameter, stacked by mode",
        "Posterior of each parameter, the modes stacked on each other by their probability.",
        good="one peak: the modes agree on this parameter.",
        bad="separate peaks in different colours: which value is right depends on the mode.",
    )


def _draw(marginal: Marginal, shares: dict[str, float], colours: dict[str, str], axes: Axes) -> None:
    below = np.zeros(len(marginal.edges) - 1)
    for name, density in marginal.density.items():
        above = below + shares[name] * density
        axes.stairs(above, marginal.edges, baseline=below, fill=True, color=colours[name])
        below = above
    parameter_axis(marginal, axes)
