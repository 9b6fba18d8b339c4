"""Each parameter's marginal posterior beside the prior and the profile likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullLocator

from mofit.report.display import compact, math_symbol, symbol, with_sd
from mofit.report.page import Block, Details, Figure, Section, Table, tabs
from mofit.report.run import Array, Cluster, Run, labels, numbers, tab_title
from mofit.report.style import FLOOR, MEASURED, cluster_colour, image_of, legend_above, line_key, panels

_BINS = 48
_STEPS = (1, 2, 2.5, 5, 10)
PROFILE_RISE = 1.3528
"""Rise of the negative log posterior that bounds a 90 % profile interval: half the 90 % quantile of chi², 1 degree."""

_WALD = 1.6449
"""Half-width of the 90 % interval of a Gaussian, in standard deviations."""


@dataclass(frozen=True)
class Marginal:
    """One parameter of one solution in its SI unit.

    `heights` is the density of the draws over `edges`, relative to the prior's (uniform in the search's scale);
    `profile_value` and `profile_nll` are empty where the run holds no profile; `earlier` is mean and sd of a
    calibration stage alone, nan where there is none.
    """

    parameter: str
    unit: str
    log: bool
    edges: Array
    heights: Array
    minimum: float
    interval: tuple[float, float]
    laplace: tuple[float, float]
    profile_value: Array
    profile_nll: Array
    profile: tuple[float, float]
    earlier: tuple[float, float]


def extract_marginals(run: Run, cluster: Cluster) -> list[Marginal]:
    """All parameters of a sampled cluster."""
    assert cluster.draws is not None
    held, nll = _profiles(cluster)
    earlier = _earlier(run)
    sd, minimum, low, high = (cluster.array(name) for name in ("laplace_sd", "value", "q05", "q95"))
    found = []
    for k, name in enumerate(cluster.parameters):
        edges, heights = _density(run, name, cluster.draws[..., k].ravel(), held[k])
        reach = _WALD * sd[k]
        found.append(
            Marginal(
                parameter=name,
                unit=run.unit(name),
                log=bool(run.is_log([name])[0]),
                edges=edges,
                heights=heights,
                minimum=float(minimum[k]),
                interval=(float(low[k]), float(high[k])),
                laplace=(float(minimum[k] - reach), float(minimum[k] + reach)),
                profile_value=held[k],
                profile_nll=nll[k],
                profile=profile_interval(held[k], nll[k]),
                earlier=earlier.get(name, (np.nan, np.nan)),
            )
        )
    return found


def _density(run: Run, name: str, draws: Array, held: Array) -> tuple[Array, Array]:
    """Bin edges in the parameter's unit, and density in the unit box (the prior's is 1)."""
    place = run.to_unit(draws[:, None], [name])[:, 0]
    low, high = np.quantile(place, [0.001, 0.999])
    if held.size:
        ends = run.to_unit(held[[0, -1], None], [name])[:, 0]
        low, high = min(low, ends[0]), max(high, ends[1])
    pad = 0.04 * (high - low) or 1e-3
    edges = np.linspace(max(low - pad, 0.0), min(high + pad, 1.0), _BINS + 1)
    heights = np.histogram(place, edges)[0] / (len(place) * (edges[1] - edges[0]))
    return run.from_unit(edges[:, None], [name])[:, 0], heights


def _profiles(cluster: Cluster) -> tuple[list[Array], list[Array]]:
    """Held values and negative log posterior per parameter, only where the profile is finite."""
    empty = [np.empty(0)] * len(cluster.parameters)
    node = cluster.node.children.get("profile")
    if node is None:
        return empty, empty
    names = labels(node, "parameter")
    rows = [names.index(name) for name in cluster.parameters]
    value, nll = numbers(node, "value")[rows], numbers(node, "nll")[rows]
    fine = [np.isfinite(row) for row in nll]
    return [v[f] for v, f in zip(value, fine, strict=True)], [n[f] for n, f in zip(nll, fine, strict=True)]


def _earlier(run: Run) -> dict[str, tuple[float, float]]:
    """Estimate and standard deviation of calibration stages alone, by parameter."""
    node = run.group("calibration")
    found = {}
    for name, stage in ({} if node is None else node.children).items():
        names = labels(stage, f"parameter_{name}")
        for parameter, value, sd in zip(names, numbers(stage, "value"), numbers(stage, "sd"), strict=True):
            found[parameter] = (float(value), float(sd))
    return found


def profile_interval(value: Array, nll: Array) -> tuple[float, float]:
    """Where a profile rises by `PROFILE_RISE`, between grid points by the root of the rise, which is nearly straight.

    Infinite on a side where the grid ends before that; nan without a profile.
    """
    if value.size < 2:
        return np.nan, np.nan
    least = int(np.argmin(nll))
    root = np.sqrt(np.maximum(nll - nll[least], 0.0))
    low = _crossing(value[least::-1], root[least::-1], -np.inf)
    return low, _crossing(value[least:], root[least:], np.inf)


def _crossing(value: Array, root: Array, open_end: float) -> float:
    target = np.sqrt(PROFILE_RISE)
    above = np.flatnonzero(root >= target)
    if above.size == 0:
        return open_end
    k = int(above[0])
    share = (target - root[k - 1]) / (root[k] - root[k - 1])
    return float(value[k - 1] + share * (value[k] - value[k - 1]))


def draw_marginal(marginal: Marginal, colour: str, axes: Axes) -> Axes:
    """Histogram scaled to peak 1 with its 90 % interval darker, the prior on the same scale, profile and minimum."""
    peak = max(float(marginal.heights.max()), np.finfo(float).tiny)
    heights, edges = marginal.heights / peak, marginal.edges
    inside = (edges[1:] > marginal.interval[0]) & (edges[:-1] < marginal.interval[1])
    axes.stairs(heights, edges, fill=True, color=colour, alpha=0.15, lw=0)
    axes.stairs(np.where(inside, heights, 0.0), edges, fill=True, color=colour, alpha=0.3, lw=0)
    axes.stairs(heights, edges, color=colour, lw=1.2)
    axes.axhline(1 / peak, color=MEASURED, lw=1.0, ls=":")
    mean, sd = marginal.earlier
    x = np.linspace(edges[0], edges[-1], 200)
    if sd > 0:
        axes.plot(x, np.exp(-0.5 * ((x - mean) / sd) ** 2), color=MEASURED, lw=1.0, ls="--")
    if marginal.profile_value.size:
        axes.plot(
            marginal.profile_value, np.exp(-marginal.profile_nll), color=FLOOR, lw=1.4, marker="o", ms=3.2, zorder=3
        )
    axes.axvline(marginal.minimum, color=MEASURED, lw=0.9)
    if marginal.log:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_locator(_log_ticks(edges[0], edges[-1]))
        axes.xaxis.set_major_formatter(lambda value, _: compact(value))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(3, steps=_STEPS))
        axes.xaxis.set_major_formatter(lambda value, _: compact(value))
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0, 1.12)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    return axes


def _log_ticks(low: float, high: float) -> FixedLocator | LogLocator:
    """Powers of ten where there is room for two, else round numbers, which a short log axis spaces nearly evenly."""
    if high > 100 * low:
        return LogLocator(numticks=5)
    if high > 5 * low:
        return LogLocator(subs=(1, 2, 5), numticks=8)
    ticks = MaxNLocator(3, steps=_STEPS).tick_values(low, high)
    return FixedLocator([float(tick) for tick in ticks if low <= tick <= high])


def marginals_section(run: Run) -> Section | None:
    """Figure and table of intervals, per solution."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for cluster in run.shown:
        if cluster.draws is None:
            continue
        marginals = extract_marginals(run, cluster)
        data[cluster.name] = marginals
        panes[tab_title(cluster)] = [
            _figure(marginals, cluster),
            Details("Table of the 90 % intervals by draws, profile and curvature", [_table(run, marginals)]),
        ]
    if not panes:
        return None
    return Section("marginals", "Each parameter alone", tabs(panes), {"clusters": data})


def _figure(marginals: list[Marginal], cluster: Cluster) -> Figure:
    colour = cluster_colour(cluster.index)
    canvas, axes, _ = panels(len(marginals), 4, 1.5, margin=(0.3, 0.4, 0.3, 0.75), gap=(0.35, 0.65))
    for marginal, panel in zip(marginals, axes, strict=True):
        draw_marginal(marginal, colour, panel)
        panel.set_title(math_symbol(marginal.parameter) + ("" if marginal.unit == "1" else f"  ({marginal.unit})"))
    handles = [
        line_key(colour, "draws, 90 % darker", lw=6, alpha=0.45),
        line_key(MEASURED, "refined minimum", lw=0.9),
        line_key(MEASURED, "prior", lw=1.0, ls=":"),
    ]
    caption = (
        "Marginal posterior of each parameter, scaled to peak 1; the prior on the same scale (it lies at the bottom "
        "where the data have taught much). Parameters searched by their logarithm have a logarithmic axis."
    )
    if any(marginal.profile_value.size for marginal in marginals):
        caption += " The profile is the best fit that is left with the parameter held there and all others free."
        handles.append(line_key(FLOOR, "profile likelihood", marker="o", ms=3.2))
    if any(marginal.earlier[1] > 0 for marginal in marginals):
        handles.append(line_key(MEASURED, "calibration stage alone", lw=1.0, ls="--"))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        f"Marginal posterior of each parameter of solution {cluster.name}, with prior and profile likelihood",
        caption,
        good="a narrow hump around the minimum; a profile runs along its outline.",
        bad="a hump no higher than the prior, one cut off at an end, or one beside the minimum or the profile: then "
        "the posterior is skewed, or priors pull.",
    )


def _table(run: Run, marginals: list[Marginal]) -> Table:
    rows = []
    for m in marginals:
        lower, upper = (float(run.of_parameters(key, [m.parameter])[0]) for key in ("lower", "upper"))
        sd = (m.interval[1] - m.interval[0]) / (2 * _WALD)

        def text(pair: tuple[float, float], sd: float = sd, box: tuple[float, float] = (lower, upper)) -> str:
            if np.isnan(pair[0]):
                return "–"
            ends = np.clip(pair, *box)
            marks = [with_sd(float(end), sd) + ("*" if end in box else "") for end in ends]
            return " … ".join(marks)

        intervals = [text(pair) for pair in (m.interval, m.profile, m.laplace)]
        rows.append([symbol(m.parameter), with_sd(m.minimum, sd), *intervals, "" if m.unit == "1" else m.unit])
    return Table(
        ["Parameter", "Minimum", "Draws", "Profile", "Curvature (Laplace)", "Unit"],
        rows,
        Markup(
            "90 % intervals. Three that agree speak of a posterior close to a Gaussian. An end with * is the bound."
        ),
        left=[5],
    )
