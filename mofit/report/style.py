"""One look for all figures: colours that colour-blind readers can tell apart, sizes in inches, no layout passes."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

# Okabe & Ito (2008): distinguishable with every common kind of colour blindness; two dark tones make it eight.
CLUSTER_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5C00", "#444444")
MEASURED = "#1d2329"
BASELINE = "#8c959f"
FLOOR = "#E69F00"
GRID = "#e3e8ed"

_STEPS = (1, 2, 2.5, 5, 10)

WIDTH = 11.2
"""Width of a figure in inches; it fills the page."""

RC: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "mofit",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.03,  # a fixed place: looking for a free one costs a third of the drawing time
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#8c959f",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": "#57606a",
    "ytick.color": "#57606a",
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "path.simplify_threshold": 0.5,
}


def cluster_colour(index: int) -> str:
    """Colour of the cluster at this place of the list; they repeat after eight."""
    return CLUSTER_COLOURS[index % len(CLUSTER_COLOURS)]


def panels(
    count: int,
    columns: int,
    height: float,
    *,
    gap: tuple[float, float] = (0.65, 0.75),
    margin: tuple[float, float, float, float] = (0.65, 0.5, 0.1, 0.6),
    lower: float = 0.0,
) -> tuple[Canvas, list[Axes], list[Axes]]:
    """A grid of panels placed by inches, so that nothing has to be measured and moved afterwards.

    Parameters
    ----------
    count, columns
        Number of panels, and how many stand in a row; a single panel takes half the width unless `columns` is 1.
    height
        Height of a panel's main axes.
    gap
        Between panels, horizontally and vertically.
    margin
        Left, bottom, right, top of the whole figure.
    lower
        Height of a second axes under each panel's main axes (a residual, say); 0 for none.

    Returns
    -------
    figure, axes, lower axes
        The lower list is empty if `lower` is 0.
    """
    columns = max(1, min(columns, max(count, 2)))
    rows = -(-count // columns)
    left, bottom, right, top = margin
    between = 0.08
    cell_height = height + (lower + between if lower else 0.0)
    width = (WIDTH - left - right - (columns - 1) * gap[0]) / columns
    total = bottom + top + rows * cell_height + (rows - 1) * gap[1]
    canvas = Canvas(figsize=(WIDTH, total))
    main, under = [], []
    for k in range(count):
        row, column = divmod(k, columns)
        x = left + column * (width + gap[0])
        y = total - top - (row + 1) * cell_height - row * gap[1]
        offset = lower + between if lower else 0.0
        axes = canvas.add_axes((x / WIDTH, (y + offset) / total, width / WIDTH, height / total))
        main.append(axes)
        if lower:
            below = canvas.add_axes((x / WIDTH, y / total, width / WIDTH, lower / total), sharex=axes)
            axes.tick_params(labelbottom=False)
            under.append(below)
    return canvas, main, under


def few_ticks(axes: Axes, x: int | None = 5, y: int | None = 4) -> None:
    """At most this many intervals between the ticks of each linear axis (None leaves it as it is)."""
    if x is not None:
        axes.xaxis.set_major_locator(MaxNLocator(x, steps=_STEPS))
    if y is not None:
        axes.yaxis.set_major_locator(MaxNLocator(y, steps=_STEPS))


LEGEND_COLUMNS = 6


def legend_height(entries: int) -> float:
    """Inches to leave above the panels for a legend of so many entries."""
    return 0.32 + 0.18 * -(-entries // LEGEND_COLUMNS)


def legend_above(canvas: Canvas, handles: Sequence[Any]) -> None:
    """One legend for the whole figure, in a row above the panels."""
    height = canvas.get_figheight()
    canvas.legend(
        handles=list(handles),
        loc="upper left",
        bbox_to_anchor=(0.0, 1 - 0.02 / height),
        ncols=min(len(handles), LEGEND_COLUMNS),
        handlelength=1.8,
        columnspacing=1.6,
    )


def line_key(colour: str, label: str, **style: Any) -> Line2D:
    """A legend entry."""
    return Line2D([], [], color=colour, label=label, **style)


def warm_up() -> None:
    """Draw what takes long the first time: fonts, symbols, a logarithmic axis, a legend."""
    with mpl.rc_context(RC):
        canvas, (axes, *_), _ = panels(1, 1, 1.0)
        axes.loglog([1, 10], [1, 10], label=r"$d_{\mathrm{M}}$")
        legend_above(canvas, axes.get_lines())
        image_of(canvas)


def image_of(canvas: Canvas) -> str:
    """The figure as an SVG data address; dense rasterised parts are drawn at 144 dpi."""
    buffer = io.BytesIO()
    canvas.savefig(buffer, format="svg", dpi=144, metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
