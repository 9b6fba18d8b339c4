"""Plots of a result, each in one axes that is taken and returned: for notebooks, papers and comparisons."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mofit.errors import InputError, did_you_mean
from mofit.report.corner import draw_corner, extract_corner
from mofit.report.display import display_unit, math_symbol
from mofit.report.error_per_test import draw_errors, extract_errors
from mofit.report.loops import draw_loop
from mofit.report.overlay import Overlay, extract_overlays, output_unit
from mofit.report.posterior import draw_marginal, extract_marginals
from mofit.report.run import Cluster, Run
from mofit.report.search_map import draw_search, extract_search
from mofit.report.style import BASELINE, FLOOR, MEASURED, cluster_colour, line_key
from mofit.report.time_traces import draw_trace


def loop(tree: xr.DataTree, test: str, ax: Axes | None = None) -> Axes:
    """Output over input in the last period of a test: measured, the baseline, and a line per solution.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    test
        Name of the test.
    ax
        Axes to draw into; by default the current ones of pyplot.

    Returns
    -------
    Axes
        The axes, for more.

    Raises
    ------
    InputError
        If the run has no such test, or no input for it.
    """
    run = Run(tree)
    found = [_overlay(run, cluster, test).last(1) for cluster in _predicted(run)]
    if not found[0].input.size:
        raise InputError.of(f"test '{test}'", "the run holds no input of it", "Draw it over time: mofit.plots.trace")
    ax = _axes(ax)
    unit = output_unit(found)
    draw_loop(found, unit, ax)
    ax.set_ylabel(unit.label(found[0].output_name))
    _legend(ax, [line_key(MEASURED, "measured", ls="none", marker="."), *_solutions(run), *_baseline(run)])
    return ax


def trace(tree: xr.DataTree, test: str, cluster: str = "c1", axes: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Measured and simulated output of a test over time, and below it the residual in the band of the noise.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    test
        Name of the test.
    cluster
        The solution.
    axes
        Two axes to draw into, output and residual; by default those of a new figure.

    Returns
    -------
    tuple of Axes
        The same two, for more.

    Raises
    ------
    InputError
        If the run has no such test or solution.
    """
    run = Run(tree)
    overlay = _overlay(run, _cluster(run, cluster), test).last(2)
    above, below = _two_axes() if axes is None else axes
    unit = output_unit([overlay])
    small = display_unit(overlay.output_unit, overlay.measured - overlay.simulated)
    draw_trace(overlay, unit, small, above, below)
    above.set_ylabel(unit.label(overlay.output_name))
    below.set_ylabel(small.label("residual"))
    below.set_xlabel("time (s)")
    solution = line_key(cluster_colour(0), f"model, {cluster}")
    noise = line_key(FLOOR, "noise, ± 2 sd", lw=6, alpha=0.4)
    _legend(above, [line_key(MEASURED, "measured", lw=2.6, alpha=0.35), solution, *_baseline(run), noise])
    return above, below


def errors(tree: xr.DataTree, ax: Axes | None = None) -> Axes:
    """NRMSD of every solution and the baseline per test, beside the noise floor.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    ax
        Axes to draw into; by default the current ones of pyplot.

    Returns
    -------
    Axes
        The axes, for more.
    """
    run = Run(tree)
    ax = _axes(ax)
    draw_errors(extract_errors(run), np.ones(len(run.tests), dtype=bool), False, ax)
    _legend(ax, [*_solutions(run), *_baseline(run), line_key(FLOOR, "noise floor", lw=5, alpha=0.5)])
    return ax


def marginal(tree: xr.DataTree, parameter: str, ax: Axes | None = None) -> Axes:
    """Posterior of one parameter, a histogram per solution; the strip above is its place in the searched box.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    parameter
        Name of the parameter.
    ax
        Axes to draw into; by default the current ones of pyplot.

    Returns
    -------
    Axes
        The axes, for more.

    Raises
    ------
    InputError
        If the run has not sampled such a parameter.
    """
    run = Run(tree)
    found = {one.parameter: one for one in extract_marginals(run)}
    one = found[_known("parameter", parameter, found)]
    ax = _axes(ax)
    draw_marginal(one, {cluster.name: cluster_colour(cluster.index) for cluster in run.clusters}, ax)
    ax.set_xlabel(_label(run, parameter))
    _legend(ax, _solutions(run))
    return ax


def corner(tree: xr.DataTree, cluster: str = "c1", ax: Axes | None = None) -> Axes:
    """Joint posterior of each pair of parameters of a solution.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    cluster
        The solution.
    ax
        Axes to draw into, best square; by default the current ones of pyplot.

    Returns
    -------
    Axes
        The axes, for more; each pair is a unit square in it.

    Raises
    ------
    InputError
        If the run has no such solution, or has not sampled it.
    """
    run = Run(tree)
    found = _cluster(run, cluster)
    if found.draws is None:
        raise InputError.of(f"solution '{cluster}'", "it was not sampled", "Name one that was")
    return draw_corner(extract_corner(run, found), cluster_colour(found.index), _axes(ax))


def search(tree: xr.DataTree, x: str, y: str | None = None, ax: Axes | None = None) -> Axes:
    """Every point that the search evaluated, over two parameters or over one and the mean NRMSD.

    Parameters
    ----------
    tree
        A result, from `mofit.open`.
    x, y
        Names of the parameters.
    ax
        Axes to draw into; by default the current ones of pyplot.

    Returns
    -------
    Axes
        The axes, for more.

    Raises
    ------
    InputError
        If the run holds no search, or no such parameter.
    """
    run = Run(tree)
    found = extract_search(run)
    if found is None:
        raise InputError.of("result", "the run holds no search", "Name another run")
    names = found.parameters
    across = names.index(_known("parameter", x, names))
    up = None if y is None else names.index(_known("parameter", y, names))
    ax = draw_search(found, across, up, run.is_log(names), _axes(ax))
    ax.set_xlabel(_label(run, x))
    if y is not None:
        ax.set_ylabel(_label(run, y))
    return ax


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


def _cluster(run: Run, name: str) -> Cluster:
    clusters = {cluster.name: cluster for cluster in run.clusters}
    return clusters[_known("solution", name, clusters)]


def _predicted(run: Run) -> list[Cluster]:
    return [cluster for cluster in run.shown if "prediction" in cluster.node.children]


def _overlay(run: Run, cluster: Cluster, test: str) -> Overlay:
    overlays = {overlay.test: overlay for overlay in extract_overlays(run, cluster)}
    return overlays[_known("test", test, overlays)]


def _label(run: Run, parameter: str) -> str:
    unit = run.unit(parameter)
    return math_symbol(parameter) + ("" if unit == "1" else f" ({unit})")


def _solutions(run: Run) -> list[Line2D]:
    return [line_key(cluster_colour(cluster.index), f"model, {cluster.name}") for cluster in run.shown]


def _baseline(run: Run) -> list[Line2D]:
    return [line_key(BASELINE, run.baseline_title, ls="--")] if run.baseline_title else []


def _legend(ax: Axes, handles: Sequence[Line2D]) -> None:
    ax.legend(handles=list(handles), fontsize="small")
