"""The posterior: marginals inside the prior box, and the directions that the data leave open, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from mofit.report.corner import corner_figure, extract_corner
from mofit.report.display import listed, math_symbol, number, symbol
from mofit.report.page import Block, Figure, Section, Text, tabs
from mofit.report.run import Array, Cluster, Run, tab_title
from mofit.report.style import cluster_colour, few_ticks, image_of, legend_above, line_key, panels

STRONG = 0.8
"""Correlation from which two parameters are said to trade against each other."""

FLAT = 0.5
"""Share of the prior's standard deviation from which a direction counts as open."""

_BINS = 48


@dataclass(frozen=True)
class Marginal:
    """Histograms of one parameter, a row per cluster (peak 1), over common bin edges in SI units."""

    parameter: str
    lower: float
    upper: float
    log: bool
    edges: Array
    heights: dict[str, Array]
    intervals: dict[str, tuple[float, float]]
    prior_place: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that the data leave open: weights in the unit box, spread over the prior's."""

    weights: dict[str, float]
    spread: float


def extract_marginals(run: Run) -> list[Marginal]:
    """Marginals of every parameter that was sampled, over the shown clusters."""
    sampled = [cluster for cluster in run.shown if cluster.draws is not None]
    names = sampled[0].parameters if sampled else []
    return [_marginal(run, sampled, name) for name in names]


def _marginal(run: Run, clusters: list[Cluster], name: str) -> Marginal:
    lower, upper = (float(run.of_parameters(key, [name])[0]) for key in ("lower", "upper"))
    columns = {c.name: c.draws[..., c.parameters.index(name)].ravel() for c in clusters if c.draws is not None}
    low = min(float(np.quantile(x, 0.001)) for x in columns.values())
    high = max(float(np.quantile(x, 0.999)) for x in columns.values())
    pad = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
    low, high = max(low - pad, lower), min(high + pad, upper)
    log = bool(run.is_log([name])[0]) and low > 0 and high > 30 * low
    edges = np.geomspace(low, high, _BINS + 1) if log else np.linspace(low, high, _BINS + 1)
    heights = {key: np.histogram(x, edges)[0].astype(float) for key, x in columns.items()}
    intervals = {key: (float(np.quantile(x, 0.05)), float(np.quantile(x, 0.95))) for key, x in columns.items()}
    place = {key: run.to_unit(np.array(pair)[:, None], [name])[:, 0] for key, pair in intervals.items()}
    return Marginal(
        parameter=name,
        lower=lower,
        upper=upper,
        log=log,
        edges=edges,
        heights={key: h / max(h.max(), 1.0) for key, h in heights.items()},
        intervals=intervals,
        prior_place={key: (float(pair[0]), float(pair[1])) for key, pair in place.items()},
    )


def correlation(run: Run, cluster: Cluster) -> Array:
    """Correlation of the posterior draws in the unit box, shape (parameter, parameter)."""
    unit = run.to_unit(_flat(cluster), cluster.parameters)
    if unit.shape[1] == 1:
        return np.ones((1, 1))
    centred = unit - unit.mean(axis=0)
    covariance = centred.T @ centred
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    return covariance / np.outer(sd, sd)


def open_directions(run: Run, cluster: Cluster) -> list[Direction]:
    """Principal directions of the posterior in the unit box along which it is more than `FLAT` as wide as the prior."""
    unit = run.to_unit(_flat(cluster), cluster.parameters)
    values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(unit.T)))
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        spread = float(np.sqrt(max(value, 0.0) * 12))
        if spread > FLAT:
            order = np.argsort(-np.abs(vector))
            main = [k for k in order if abs(vector[k]) > 0.3]
            sign = np.sign(vector[main[0]])
            found.append(Direction({cluster.parameters[k]: float(sign * vector[k]) for k in main}, spread))
    return found


def _flat(cluster: Cluster) -> Array:
    assert cluster.draws is not None
    return cluster.draws.reshape(-1, cluster.draws.shape[-1])


def draw_marginal(marginal: Marginal, colours: dict[str, str], axes: Axes) -> Axes:
    """Histograms, and above them a strip that shows the 5–95 % intervals inside the whole prior box."""
    for name, heights in reversed(marginal.heights.items()):
        axes.stairs(heights, marginal.edges, color=colours[name], lw=1.3)
        axes.stairs(heights, marginal.edges, color=colours[name], fill=True, alpha=0.18, lw=0)
    if marginal.log:
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
    else:
        few_ticks(axes, 4, None)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_ylim(0, 1.05)
    axes.set_xlim(marginal.edges[0], marginal.edges[-1])
    strip = axes.inset_axes((0.0, 1.05, 1.0, 0.05 + 0.035 * len(marginal.heights)))
    strip.set_xlim(0, 1)
    strip.set_ylim(-0.6, len(marginal.heights) - 0.4)
    strip.set_xticks([])
    strip.set_yticks([])
    strip.set_facecolor("#eef1f4")
    for spine in strip.spines.values():
        spine.set_visible(False)
    for k, (name, (low, high)) in enumerate(reversed(marginal.prior_place.items())):
        middle, half = (low + high) / 2, max((high - low) / 2, 0.006)
        strip.barh(k, 2 * half, left=middle - half, height=0.8, color=colours[name])
    return axes


def posterior_section(run: Run) -> Section | None:
    """Marginals, then per cluster the corner plot and the open directions in words."""
    marginals = extract_marginals(run)
    if not marginals:
        return None
    sampled = [cluster for cluster in run.shown if cluster.draws is not None]
    panes: dict[str, list[Block]] = {}
    data = {}
    for cluster in sampled:
        matrix, directions = correlation(run, cluster), open_directions(run, cluster)
        data[cluster.name] = {"parameters": cluster.parameters, "correlation": matrix, "open_directions": directions}
        blocks: list[Block] = [Text(_words(cluster, matrix, directions))]
        if len(cluster.parameters) > 1:
            blocks.append(corner_figure(extract_corner(run, cluster), cluster))
        panes[tab_title(cluster)] = blocks
    return Section(
        "posterior", "Posterior", [_figure(run, marginals), *tabs(panes)], {"marginals": marginals, "clusters": data}
    )


def _words(cluster: Cluster, matrix: Array, directions: list[Direction]) -> Markup:
    names = cluster.parameters
    strong = [
        (names[i], names[j], matrix[i, j])
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if abs(matrix[i, j]) > STRONG
    ]
    strong.sort(key=lambda item: -abs(item[2]))
    sentences = [
        Markup("{} and {} {} (correlation {}): the data fix {} better than either alone.").format(
            symbol(a),
            symbol(b),
            "rise together" if r > 0 else "trade against each other",
            number(r, 2),
            "their ratio or difference" if r > 0 else "their product or sum",
        )
        for a, b, r in strong[:5]
    ]
    for direction in directions[:4]:
        moving = [symbol(n) + (" up" if w > 0 else " down") for n, w in direction.weights.items()]
        share = f"{100 * min(direction.spread, 1.0):.0f} %"
        if len(moving) == 1:
            subject = symbol(next(iter(direction.weights)))
            sentences.append(
                Markup("{} is left open: the posterior is {} as wide as the prior.").format(subject, share)
            )
        else:
            text = (
                "Open direction: moving {} changes the fit little; along it the posterior is {} as wide as the prior."
            )
            sentences.append(Markup(text).format(listed(moving), share))
    if not sentences and len(names) == 1:
        return Markup("The data pin {}.").format(symbol(names[0]))
    if not sentences:
        return Markup(
            "No two parameters are strongly correlated (all below {}), and no direction is left open."
        ).format(STRONG)
    return Markup(" ").join(sentences)


def _figure(run: Run, marginals: list[Marginal]) -> Figure:
    canvas, axes, _ = panels(len(marginals), 4, 1.5, margin=(0.3, 0.4, 0.3, 1.05), gap=(0.35, 1.05))
    colours = {c.name: cluster_colour(c.index) for c in run.shown}
    for marginal, panel in zip(marginals, axes, strict=True):
        draw_marginal(marginal, colours, panel)
        unit = run.unit(marginal.parameter)
        title = math_symbol(marginal.parameter) + ("" if unit == "1" else f"  ({unit})")
        panel.set_title(title, pad=10 + 6 * len(marginal.heights))
    legend_above(canvas, [line_key(colours[n], f"solution {n}", lw=5, alpha=0.7) for n in marginals[0].heights])
    return Figure(
        image_of(canvas),
        "Marginal posterior of each parameter",
        "Marginal posterior of each parameter, scaled to equal height (the weights of the solutions are in the "
        "table above). The "
        "strip over each panel is the whole search box, with the 5–95 % interval in it.",
        good="narrow humps that cover a small part of the strip.",
        bad="a flat shape over the whole strip (the data say nothing), or a hump cut off at an end of the strip.",
    )
