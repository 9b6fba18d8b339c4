"""Plots of a result, each in one axes that is taken and returned: for notebooks, papers and comparisons.

Each function takes a result ``tree`` (`mofit.open`) and the axes ``ax`` to draw into, by default the current ones of
pyplot. It returns the axes, for more. A name that the run does not hold raises `InputError`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mofit.errors import InputError, did_you_mean
from mofit.report.corner import draw_corner, extract_corner
from mofit.report.errors import draw_errors, extract_errors
from mofit.report.marginals import draw_marginal, draw_place, extract_marginals
from mofit.report.overlay import Overlay, extract_overlays, output_unit
from mofit.report.run import Mode, Run
from mofit.report.search_map import draw_search, extract_search
from mofit.report.signals import draw_loop, draw_trace
from mofit.report.toolkit.figures import (
    FLOOR,
    MEASURED,
    as_written,
    band_key,
    baseline_key,
    dot_key,
    line_key,
    mode_colour,
)
from mofit.report.toolkit.formatting import display_unit, math_symbol, parameter_label

if TYPE_CHECKING:
    import pandas as pd


def loop(tree: xr.DataTree, test: str, ax: Axes | None = None) -> Axes:
    """Output over input in the last period of a test: measured, the baseline, and a line per posterior mode.

    Raises
    ------
    InputError
        If the run has no such test, or no input for it.
    """
    run = Run(tree)
    found = [_overlay(run, mode, test).last(1) for mode in run.shown if "prediction" in mode.node.children]
    if not found[0].input.size:
        raise InputError.of(f"test '{test}'", "the run holds no input of it", "Draw it over time: mofit.plots.trace")
    ax = _axes(ax)
    unit = output_unit(found)
    draw_loop(found, unit, ax)
    ax.set_ylabel(unit.label(found[0].output_name))
    return _with_legend(
        ax, [dot_key(MEASURED, "measured", marker="."), *_modes(run), *baseline_key(run.baseline_title)]
    )


def trace(tree: xr.DataTree, test: str, mode: str = "m1", axes: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Measured and simulated output of a test over time, and below it the residual in the band of the noise.

    Takes and returns two axes, output and residual; by default those of a new figure.
    """
    run = Run(tree)
    overlay = _overlay(run, _mode(run, mode), test).last(2)
    above, below = _two_axes() if axes is None else axes
    unit = output_unit([overlay])
    small = display_unit(overlay.output_unit, overlay.measured - overlay.simulated)
    draw_trace(overlay, unit, small, above, below)
    above.set_ylabel(unit.label(overlay.output_name))
    below.set_ylabel(small.label("residual"))
    below.set_xlabel("time (s)")
    measured, model = line_key(MEASURED, "measured", lw=2.6, alpha=0.35), line_key(mode_colour(0), f"model, {mode}")
    noise = band_key(FLOOR, "noise, ± 2 sd")
    return _with_legend(above, [measured, model, *baseline_key(run.baseline_title), noise]), below


def errors(tree: xr.DataTree, ax: Axes | None = None) -> Axes:
    """NRMSD of every posterior mode and the baseline per test, beside the noise floor."""
    run, ax = Run(tree), _axes(ax)
    draw_errors(extract_errors(run), np.ones(len(run.objectives), dtype=bool), False, ax)
    floor = band_key(FLOOR, "noise floor", 0.5)
    return _with_legend(ax, [*_modes(run), *baseline_key(run.baseline_title), floor])


def marginal(tree: xr.DataTree, parameter: str, ax: Axes | None = None) -> Axes:
    """Posterior of one parameter, a histogram per mode; the strip above is its place in the prior box.

    Raises
    ------
    InputError
        If the run has not sampled such a parameter.
    """
    run = Run(tree)
    found = {one.parameter: one for one in extract_marginals(run)}
    one = found[_known("parameter", parameter, found)]
    ax = _axes(ax)
    colours = {mode.name: mode.colour for mode in run.modes}
    draw_marginal(one, colours, ax)
    draw_place(one, colours, ax)
    ax.set_xlabel(parameter_label(parameter, one.unit))
    return _with_legend(ax, _modes(run))


def corner(tree: xr.DataTree, mode: str = "m1", ax: Axes | None = None) -> Axes:
    """Joint posterior of each pair of parameters of a mode, each a unit square; the axes are best square.

    Raises
    ------
    InputError
        If the run has no such mode, or has not sampled it.
    """
    run = Run(tree)
    found = _mode(run, mode)
    if not found.sampled:
        raise InputError.of(f"mode '{mode}'", "it was not sampled", "Name one that was")
    return draw_corner(extract_corner(run, found), found.colour, _axes(ax))


def search(tree: xr.DataTree, x: str, y: str | None = None, ax: Axes | None = None) -> Axes:
    """Every point that the search evaluated, over two parameters or over one and the mean NRMSD.

    Raises
    ------
    InputError
        If the run holds no search, or no such parameter.
    """
    found = extract_search(Run(tree))
    if found is None:
        raise InputError.of("result", "the run holds no search", "Name another run")
    names = found.parameters
    across = names.index(_known("parameter", x, names))
    up = None if y is None else names.index(_known("parameter", y, names))
    return draw_search(found, across, up, _axes(ax))


def expected_sd(table: pd.DataFrame, ax: Axes | None = None) -> Axes:
    """Expected standard deviation of every parameter over its value: per experiment, or before and after a design.

    Parameters
    ----------
    table
        What `mofit.summary` makes of a comparison or of a design.
    ax
        Axes to draw into.

    Raises
    ------
    InputError
        If the table is of something else.
    """
    columns = {"relative_sd_before": "before", "relative_sd": "with the design"}
    if table.index.nlevels == 2 and "relative_sd" in table:
        shown = table["relative_sd"].unstack(0, sort=False)
    elif set(columns) <= set(table.columns):
        shown = table[list(columns)].rename(columns=columns)
    else:
        raise InputError.of(
            "table", "holds no expected standard deviations", "Give mofit.summary(comparison or design)"
        )
    ax = _axes(ax)
    places, colours = np.arange(len(shown)), [mode_colour(k) for k in range(shown.shape[1])]
    for colour, column in zip(colours, shown, strict=True):
        ax.plot(100 * shown[column].to_numpy(dtype=float), places, "o", color=colour)
    ax.set_xscale("log")
    ax.set_xlabel("expected standard deviation (% of the value)")
    ax.set_yticks(places, [math_symbol(name) for name in shown.index])
    ax.set_ylim(len(shown) - 0.5, -0.5)
    return _with_legend(ax, [dot_key(*entry) for entry in zip(colours, map(str, shown), strict=True)])


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.gca()


def _two_axes() -> tuple[Axes, Axes]:
    import matplotlib.pyplot as plt

    _, (above, below) = plt.subplots(2, sharex=True, height_ratios=(2, 1), layout="constrained")
    return above, below


def _known(what: str, name: str, known: Iterable[str]) -> str:
    names = list(known)
    if name not in names:
        raise InputError.of(f"{what} '{name}'", "the run has none of this name", did_you_mean(name, names))
    return name


def _mode(run: Run, name: str) -> Mode:
    modes = {mode.name: mode for mode in run.modes}
    return modes[_known("mode", name, modes)]


def _overlay(run: Run, mode: Mode, test: str) -> Overlay:
    overlays = {overlay.test: overlay for overlay in extract_overlays(run, mode)}
    return overlays[_known("test", test, overlays)]


def _modes(run: Run) -> list[Line2D]:
    return [line_key(mode.colour, f"model, {mode.name}") for mode in run.shown]


def _with_legend(ax: Axes, handles: list[Line2D]) -> Axes:
    ax.legend(handles=handles, fontsize="small")
    as_written(ax)
    return ax
