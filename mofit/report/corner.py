"""A corner plot in a single axes: densities below the diagonal, marginals on it, correlations above."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from mofit._typing import FloatArray
from mofit.report.run import Mode, Run
from mofit.report.toolkit.blocks import Figure, Section, tabs
from mofit.report.toolkit.figures import MEASURED, SOFT, WIDTH, Panels
from mofit.report.toolkit.formatting import Unit, math_symbol, number, symbol

_BINS = 64
_LEVELS = (0.95, 0.68, 0.39)
"""Shares of the draws inside the shaded regions: two, 1.5 and one sigma of a Gaussian in two dimensions, rounded."""

_GAP = 0.06

_LONGEST = 10
"""Characters of a tick that fit left of a row."""


@dataclass(frozen=True)
class Corner:
    """Draws of one mode in the unit box, with each axis cut to the central 99 % of the draws."""

    parameters: list[str]
    units: list[str]
    place: FloatArray
    low: FloatArray
    high: FloatArray
    quantiles: FloatArray
    correlation: FloatArray
    estimate: FloatArray


def extract_corner(run: Run, mode: Mode) -> Corner:
    """Posterior draws of a mode, ready to draw; quantiles (5, 50, 95 %) are in SI units."""
    space, flat = run.space(mode.parameters), mode.flat_draws
    place = space.to_unit(flat)
    low, high = np.quantile(place, [0.005, 0.995], axis=0)
    pad = np.maximum(0.06 * (high - low), 1e-9)
    return Corner(
        parameters=mode.parameters,
        units=list(space.units),
        place=place,
        low=low - pad,
        high=high + pad,
        quantiles=np.quantile(flat, [0.05, 0.5, 0.95], axis=0),
        correlation=np.corrcoef(place.T).reshape(len(space), -1),
        estimate=space.to_unit(mode.array("value")),
    )


def draw_corner(corner: Corner, colour: str, axes: Axes) -> Axes:
    """Draw all cells into one axes, a unit square per cell, the first parameter at the top left."""
    d = len(corner.parameters)
    inside = (corner.place - corner.low) / (corner.high - corner.low)
    mark = (corner.estimate - corner.low) / (corner.high - corner.low)
    ticks = [(np.quantile(inside[:, k], 0.05), np.quantile(inside[:, k], 0.95)) for k in range(d)]
    axes.imshow(_shading(inside, colour), extent=(0, d, 0, d), interpolation="bilinear", aspect="auto", zorder=1)
    for row in range(d):
        for column in range(row + 1):
            _frame(axes, column, d - 1 - row)
            if column < row and 0 <= mark[column] <= 1 and 0 <= mark[row] <= 1:
                x, y = column + _scale(mark[column]), d - 1 - row + _scale(mark[row])
                axes.plot(x, y, marker="+", color=MEASURED, ms=7, mew=1.2, zorder=4)
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


def _shading(inside: FloatArray, colour: str) -> FloatArray:
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


def _kernel(width: float) -> FloatArray:
    """Matrix that smooths a histogram of `_BINS` bins with a Gaussian of this width in bins, keeping its sum."""
    distance = np.subtract.outer(np.arange(_BINS), np.arange(_BINS))
    weights = np.exp(-0.5 * (distance / width) ** 2)
    return weights / weights.sum(axis=0)


def _frame(axes: Axes, x: int, y: int) -> None:
    low, high = _GAP, 1 - _GAP
    corners_x = [x + low, x + high, x + high, x + low, x + low]
    axes.plot(corners_x, [y + low, y + low, y + high, y + high, y + low], color="#c8d0d8", lw=0.7, zorder=2)


def _marginal(axes: Axes, values: FloatArray, x: int, y: int, colour: str) -> None:
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
    label = Unit(unit).label(quantity)
    small = 7.0 if d > 6 else 8.0
    row = d - 1 - k
    for place, text in zip(ticks, texts, strict=True):
        axes.plot([k + _scale(place)] * 2, [-0.03, 0.03], color=SOFT, lw=0.8, clip_on=False)
        axes.text(
            k + _scale(place), -0.06, text, rotation=40, ha="right", va="top", rotation_mode="anchor", fontsize=small
        )
        if k:
            axes.plot([-0.03, 0.03], [row + _scale(place)] * 2, color=SOFT, lw=0.8, clip_on=False)
            axes.text(-0.06, row + _scale(place), text, ha="right", va="center", fontsize=small)
    axes.text(k + 0.5, d - k + 0.02, label, ha="center", va="bottom", fontsize=small + 1.5, fontweight="bold")


def tick_texts(low: float, median: float, high: float) -> tuple[tuple[str, str], bool]:
    """Texts of the 5 and 95 % quantiles, with the digits that distinguish them: two of their distance, at least three.

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


def _closest(corner: Corner) -> Markup:
    """The two parameters with the strongest correlation."""
    size = np.abs(np.tril(np.nan_to_num(corner.correlation), -1))
    j, k = np.unravel_index(np.argmax(size), size.shape)
    if not size[j, k]:
        return Markup("")
    return Markup("{} and {} are correlated most: {}.").format(
        symbol(corner.parameters[k]), symbol(corner.parameters[j]), number(float(corner.correlation[j, k]), 2)
    )


def corner_figure(run: Run, mode: Mode) -> Figure:
    """The corner plot with its caption; a cell is as large as the number of parameters allows."""
    d, left = len(mode.parameters), 0.75
    cell = min((WIDTH - left - 0.1) / d, 2.3)
    panels = Panels(1, 1, d * cell, margin=(left, 0.7, WIDTH - left - d * cell))
    corner = extract_corner(run, mode)
    draw_corner(corner, mode.colour, panels.axes[0])
    return panels.figure(
        f"Corner plot of the posterior of mode {mode.name}",
        "Joint posterior of each pair of parameters. The shades hold 39, 68 and 95 % of the draws. The cross is the "
        "MAP estimate. Ticks are the 5 and 95 % quantiles, less the median where the name says so. Numbers are "
        "correlations. Each axis shows the central 99 % of the draws.",
        good="round, compact shapes with the cross in the darkest part.",
        bad="long thin ridges (correlated parameters), curved shapes, or shapes truncated by a bound.",
        finding=_closest(corner),
        explore=False,
    )


def corner_section(run: Run) -> Section | None:
    """A corner plot per mode, where there is more than one parameter."""
    panes = {mode.title: [corner_figure(run, mode)] for mode in run.sampled if len(mode.parameters) > 1}
    return Section("corner", "Joint posterior of each pair", tabs(panes)) if panes else None
