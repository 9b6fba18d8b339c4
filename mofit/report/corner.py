"""A corner plot in a single axes: densities below the diagonal, marginals on it, correlations above."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure as Canvas

from mofit.report.display import math_symbol, number
from mofit.report.page import Block, Figure, Section, tabs
from mofit.report.run import Array, Cluster, Run, tab_title
from mofit.report.style import WIDTH, cluster_colour, image_of

_BINS = 64
_LEVELS = (0.95, 0.68, 0.39)
"""Shares of the draws inside the shaded regions: two, 1.5 and one sigma of a Gaussian in two dimensions, rounded."""

_GAP = 0.06

_LONGEST = 10
"""Characters of a tick that fit left of a row."""


@dataclass(frozen=True)
class Corner:
    """Draws of one cluster in the unit box, with each axis cut to the central 99 % of the draws."""

    parameters: list[str]
    units: list[str]
    place: Array
    low: Array
    high: Array
    quantiles: Array
    correlation: Array
    minimum: Array


def extract_corner(run: Run, cluster: Cluster) -> Corner:
    """Posterior draws of a cluster, ready to draw; quantiles (5, 50, 95 %) are in SI units."""
    assert cluster.draws is not None
    flat = cluster.draws.reshape(-1, cluster.draws.shape[-1])
    place = run.to_unit(flat, cluster.parameters)
    low, high = np.quantile(place, [0.005, 0.995], axis=0)
    pad = np.maximum(0.06 * (high - low), 1e-9)
    matrix = np.atleast_2d(np.corrcoef(place.T)) if place.shape[1] > 1 else np.ones((1, 1))
    return Corner(
        parameters=cluster.parameters,
        units=[run.unit(name) for name in cluster.parameters],
        place=place,
        low=low - pad,
        high=high + pad,
        quantiles=np.quantile(flat, [0.05, 0.5, 0.95], axis=0),
        correlation=matrix,
        minimum=run.to_unit(cluster.array("value"), cluster.parameters),
    )


def draw_corner(corner: Corner, colour: str, axes: Axes) -> Axes:
    """Draw all cells into one axes, a unit square per cell, the first parameter at the top left."""
    d = len(corner.parameters)
    inside = (corner.place - corner.low) / (corner.high - corner.low)
    mark = (corner.minimum - corner.low) / (corner.high - corner.low)
    ticks = [(np.quantile(inside[:, k], 0.05), np.quantile(inside[:, k], 0.95)) for k in range(d)]
    axes.imshow(_shading(inside, colour), extent=(0, d, 0, d), interpolation="bilinear", aspect="auto", zorder=1)
    for row in range(d):
        for column in range(row + 1):
            _frame(axes, column, d - 1 - row)
            if column < row and 0 <= mark[column] <= 1 and 0 <= mark[row] <= 1:
                x, y = column + _scale(mark[column]), d - 1 - row + _scale(mark[row])
                axes.plot(x, y, marker="+", color="#1d2329", ms=7, mew=1.2, zorder=4)
        _marginal(axes, inside[:, row], row, d - 1 - row, colour)
        for column in range(row):
            _coefficient(axes, corner.correlation[row, column], row, d - 1 - column, d)
        _labels(axes, corner, row, ticks[row], d)
    axes.set_xlim(0, d)
    axes.set_ylim(0, d)
    axes.axis("off")
    return axes


def _scale(x: float) -> float:
    return _GAP + (1 - 2 * _GAP) * x


def _shading(inside: Array, colour: str) -> Array:
    """One image of all densities below the diagonal: darker inside the region that holds fewer of the draws."""
    d = inside.shape[1]
    cell = _BINS
    border = round(_GAP * cell / (1 - 2 * _GAP))
    size = cell + 2 * border
    image = np.zeros((d * size, d * size, 4), dtype=np.uint8)  # bytes: half the time that numbers take to draw
    image[..., :3] = np.round(255 * np.array(to_rgb(colour)))
    kernel = _kernel(1.6)
    for row in range(d):
        for column in range(row):
            bins, _, _ = np.histogram2d(inside[:, row], inside[:, column], bins=cell, range=((0, 1), (0, 1)))
            smooth = kernel @ bins @ kernel.T
            ordered = np.sort(smooth.ravel())[::-1]
            mass = np.cumsum(ordered) / max(ordered.sum(), 1e-300)
            alpha = np.zeros_like(image, shape=smooth.shape)
            for level, shade in zip(_LEVELS, (56, 128, 217), strict=True):
                threshold = ordered[min(int(np.searchsorted(mass, level)), ordered.size - 1)]
                alpha[smooth >= max(threshold, 1e-300)] = shade
            top, left = row * size + border, column * size + border
            image[top : top + cell, left : left + cell, 3] = alpha[::-1]
    return image


def _kernel(width: float) -> Array:
    """Matrix that smooths a histogram of `_BINS` bins with a Gaussian of this width in bins, keeping its sum."""
    distance = np.subtract.outer(np.arange(_BINS), np.arange(_BINS))
    weights = np.exp(-0.5 * (distance / width) ** 2)
    return weights / weights.sum(axis=0)


def _frame(axes: Axes, x: int, y: int) -> None:
    low, high = _GAP, 1 - _GAP
    corners_x = [x + low, x + high, x + high, x + low, x + low]
    axes.plot(corners_x, [y + low, y + low, y + high, y + high, y + low], color="#c8d0d8", lw=0.7, zorder=2)


def _marginal(axes: Axes, values: Array, x: int, y: int, colour: str) -> None:
    heights, edges = np.histogram(values, bins=_BINS, range=(0, 1))
    smooth = _kernel(1.2) @ heights
    middle = x + _scale(0.5 * (edges[1:] + edges[:-1]))
    top = y + _GAP + (1 - 2.6 * _GAP) * smooth / max(smooth.max(), 1e-300)
    axes.fill_between(middle, y + _GAP, top, color=colour, alpha=0.25, lw=0, zorder=2)
    axes.plot(middle, top, color=colour, lw=1.3, zorder=3)


def _coefficient(axes: Axes, r: float, x: int, y: int, d: int) -> None:
    strength = min(abs(r), 1.0)
    axes.text(
        x + 0.5, y + 0.5, f"{r:+.2f}".replace("-", "−"), ha="center", va="center",
        fontsize=(8 if d > 6 else 10) + 3 * strength, color=str(0.72 * (1 - strength)),
        fontweight="bold" if strength > 0.8 else "normal",
    )  # fmt: skip


def _labels(axes: Axes, corner: Corner, k: int, ticks: tuple[float, float], d: int) -> None:
    """Name and 5 % and 95 % marks of one parameter, under its column and left of its row."""
    name, unit = math_symbol(corner.parameters[k]), corner.units[k]
    texts, beyond_median = tick_texts(*corner.quantiles[:, k])
    quantity = f"{name} − median" if beyond_median else name
    label = quantity if unit == "1" else f"{quantity} ({unit})"
    small = 7.0 if d > 6 else 8.0
    row = d - 1 - k
    for place, text in zip(ticks, texts, strict=True):
        axes.plot([k + _scale(place)] * 2, [-0.03, 0.03], color="#57606a", lw=0.8, clip_on=False)
        axes.text(
            k + _scale(place), -0.06, text, rotation=40, ha="right", va="top", rotation_mode="anchor", fontsize=small
        )
        if k:
            axes.plot([-0.03, 0.03], [row + _scale(place)] * 2, color="#57606a", lw=0.8, clip_on=False)
            axes.text(-0.06, row + _scale(place), text, ha="right", va="center", fontsize=small)
    axes.text(k + 0.5, d - k + 0.02, label, ha="center", va="bottom", fontsize=small + 1.5, fontweight="bold")


def tick_texts(low: float, median: float, high: float) -> tuple[tuple[str, str], bool]:
    """Texts of the 5 and 95 % quantiles, with the digits that tell them apart: two of their distance, at least three.

    Where that makes them too long to stand beside a row, they are distances from the median: the second value.
    """
    width = high - low
    if not width > 0:
        return (number(low), ""), False
    digits = 2 + math.floor(math.log10(max(abs(low), abs(high)))) - math.floor(math.log10(width))
    texts = number(low, max(3, digits)), number(high, max(3, digits))
    if digits > 3 and max(map(len, texts)) > _LONGEST:
        return (number(low - median, 2), number(high - median, 2)), True
    return texts, False


def corner_figure(corner: Corner, cluster: Cluster) -> Figure:
    """The corner plot with its caption; a cell is as large as the number of parameters allows."""
    d = len(corner.parameters)
    left, bottom, top, right = 0.75, 0.7, 0.35, 0.1
    cell = min((WIDTH - left - right) / d, 2.3)
    canvas = Canvas(figsize=(WIDTH, bottom + top + d * cell))
    height = canvas.get_figheight()
    axes = canvas.add_axes((left / WIDTH, bottom / height, d * cell / WIDTH, d * cell / height))
    draw_corner(corner, cluster_colour(cluster.index), axes)
    return Figure(
        image_of(canvas),
        f"Corner plot of the posterior of solution {cluster.name}",
        "Joint posterior of each pair of parameters: the shades hold 39, 68 and 95 % of the draws, the cross is "
        "the refined "
        "minimum, ticks are the 5 and 95 % quantiles (less the median where the name says so), numbers are "
        "correlations. Each axis is cut to the central 99 % of the draws.",
        good="round, compact shapes with the cross in the darkest part.",
        bad="long thin ridges (parameters that can't be told apart), bananas, or shapes cut off by a bound.",
    )


def corner_section(run: Run) -> Section | None:
    """A corner plot per solution, where there is more than one parameter."""
    panes: dict[str, list[Block]] = {
        tab_title(cluster): [corner_figure(extract_corner(run, cluster), cluster)]
        for cluster in run.shown
        if cluster.draws is not None and len(cluster.parameters) > 1
    }
    return Section("corner", "Joint posterior of each pair", tabs(panes)) if panes else None
