"""One look for all figures: panels placed by inches under one legend, colours for colour-blind readers."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import ArrayLike

from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.description import described, keyed, legend_entries, rounded, test_of
from mofit.report.toolkit.formatting import html_of_math, is_math

MODE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5C00", "#444444")
"""Okabe & Ito (2008): distinguishable with every common kind of colour blindness; two dark tones make it eight."""

MEASURED = "#1d2329"
BASELINE = "#8c959f"
FLOOR = "#E69F00"
SOFT = "#57606a"
_GRID = "#e3e8ed"

WIDTH = 11.2
"""Width of a figure in inches; it fills the page."""

_RC: Any = {
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
    "axes.edgecolor": BASELINE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "grid.color": _GRID,
    "grid.linewidth": 0.7,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "path.simplify_threshold": 0.5,
}

_LEGEND_COLUMNS = 6
_BETWEEN = 0.08  # inches between a panel and the axes under it
_TITLE = 0.35  # inches above a panel for its title
_LABEL = 0.22  # inches between a label of the ordinate and the edge of the figure


def styled() -> AbstractContextManager[None]:
    """The look of all figures, for the time of a ``with`` block; `draw_sections` enters it."""
    return mpl.rc_context(_RC)


def mode_colour(index: int) -> str:
    """Colour of the mode at this place of the list; they repeat after eight."""
    return MODE_COLOURS[index % len(MODE_COLOURS)]


class Panels:
    """A figure of equal panels, placed by inches, so that nothing has to be measured and moved afterwards.

    Parameters
    ----------
    count, columns
        Number of panels, and how many stand in a row; a single panel takes half the width unless `columns` is 1.
    height
        Height of a panel's main axes [inches].
    legend
        Entries of the one legend of the figure, above the panels; see `line_key`, `dot_key` and `band_key`.
    margin
        Left, bottom and right of the whole figure [inches].
    top
        Above the panels [inches]; by default room for the titles and the legend.
    gap
        Between panels, horizontally and vertically [inches].
    lower
        Height of a second axes under each panel's main axes (a residual, say) [inches]; 0 for none.

    Attributes
    ----------
    axes, lower
        Main axes of every panel, and those under them (an empty list if there are none).
    canvas
        The matplotlib figure.
    """

    def __init__(
        self,
        count: int,
        columns: int,
        height: float,
        *,
        legend: Sequence[Line2D] = (),
        margin: tuple[float, float, float] = (0.75, 0.5, 0.15),
        top: float | None = None,
        gap: tuple[float, float] = (0.65, 0.75),
        lower: float = 0.0,
    ) -> None:
        self._columns = max(1, min(columns, max(count, 2)))
        self._heights = height, lower
        self._legend = list(legend)
        self._labels = {"x": "", "y": "", "lower": ""}
        self._on_request: list[tuple[Axes, dict[str, Any]]] = []
        left, bottom, right = margin
        if top is None:
            top = _legend_height(len(legend)) + 0.15 if legend else _TITLE
        rows = -(-count // self._columns)
        offset = lower + _BETWEEN if lower else 0.0
        width = (WIDTH - left - right - (self._columns - 1) * gap[0]) / self._columns
        total = bottom + top + rows * (height + offset) + (rows - 1) * gap[1]
        self._label_place = -(left - _LABEL) / width
        self.canvas = Canvas(figsize=(WIDTH, total))
        self.axes: list[Axes] = []
        self.lower: list[Axes] = []
        for k in range(count):
            row, column = divmod(k, self._columns)
            x = left + column * (width + gap[0])
            y = total - top - (row + 1) * (height + offset) - row * gap[1]
            axes = self.canvas.add_axes((x / WIDTH, (y + offset) / total, width / WIDTH, height / total))
            self.axes.append(axes)
            if lower:
                place = (x / WIDTH, y / total, width / WIDTH, lower / total)
                self.lower.append(self.canvas.add_axes(place, sharex=axes))
                axes.tick_params(labelbottom=False)
        if legend:
            self.canvas.legend(
                handles=list(legend),
                loc="upper left",
                bbox_to_anchor=(0.0, 1 - 0.02 / total),
                ncols=min(len(legend), _LEGEND_COLUMNS),
                handlelength=1.8,
                columnspacing=1.6,
            )

    def label(self, x: str = "", y: str = "", lower: str = "") -> None:
        """Label the abscissa of the lowest panel of each column, and the ordinates of the first panel of each row."""
        self._labels = {"x": x, "y": y, "lower": lower}
        for k, axes in enumerate(self.axes):
            under = self.lower[k] if self.lower else axes
            if x and k + self._columns >= len(self.axes):
                under.set_xlabel(x)
            if k % self._columns == 0:
                for panel, text in ((axes, y), (under, lower)):
                    if text:
                        panel.set_ylabel(text)
                        panel.yaxis.set_label_coords(self._label_place, 0.5)

    def on_request(self, axes: Axes, name: str, x: ArrayLike, y: ArrayLike, colour: str, **keys: str) -> None:
        """A curve that only an explored figure shows, while its keys are chosen."""
        curve = {"kind": "line", "name": name, "x": rounded(x), "y": rounded(y), "colour": colour, "keys": keys}
        self._on_request.append(
            (axes, curve | {"width": 1.6, "dash": "solid", "alpha": 1.0, "dots": {}, "asked": True})
        )

    def figure(
        self,
        alt: str,
        caption: Markup | str,
        *,
        good: Markup | str = "",
        bad: Markup | str = "",
        finding: Markup | str = "",
        explore: bool = True,
        **features: Any,
    ) -> Figure:
        """The figure as an SVG inside the page, and what its axes show, to be explored.

        Dense rasterised parts of the SVG are drawn at 144 dpi.

        Parameters
        ----------
        alt
            What is drawn, for who can't see it.
        caption
            What to see in such a figure.
        good, bad
            What good and bad look like.
        finding
            What is to be seen in this one, in a sentence.
        explore
            Whether the axes can be read; images, and axes within axes, can't.
        features
            What else the script is to know of the figure, such as ``brush=True`` for parallel coordinates.
        """
        as_written(self.canvas)
        buffer = io.BytesIO()
        self.canvas.savefig(buffer, format="svg", dpi=144, metadata={"Date": None, "Creator": None})
        address = "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
        found = self._described() | features if explore else None
        width, height = (round(96 * length) for length in self.canvas.figure.get_size_inches())
        return Figure(address, alt, caption, good, bad, finding, found, (width, height))

    def _described(self) -> dict[str, Any]:
        """Panels with their parts and axes, each with the labels that the outer ones show for all."""
        panels = [described(axes, self._legend) | {"height": self._heights[0]} for axes in self.axes]
        for k, panel in enumerate(panels):
            panel["x"]["title"] = panel["x"]["title"] or html_of_math(self._labels["x"])
            panel["y"]["title"] = panel["y"]["title"] or html_of_math(self._labels["y"])
            if self.lower:
                below = described(self.lower[k], self._legend) | {"height": self._heights[1]}
                below["y"]["title"] = below["y"]["title"] or html_of_math(self._labels["lower"])
                panel["lower"] = below
        places = dict(zip(self.axes, panels, strict=True))
        places |= {axes: panel["lower"] for axes, panel in zip(self.lower, panels, strict=False)}
        for axes, curve in self._on_request:
            places[axes]["parts"].append(curve)
        return {"columns": self._columns, "panels": panels, "legend": legend_entries(self._legend)}


def panel_of(axes: Axes, test: str, title: str = "") -> None:
    """Title of a panel that belongs to one test: who chooses another does not see it."""
    axes.set_title(title or test)
    keyed(axes, test=test_of(test))


def as_written(owner: Artist) -> None:
    """Let names of tests, channels and models stand as they are, dollar signs too: only our own symbols are math."""
    for text in owner.findobj(Text):
        if isinstance(text, Text) and "$" in text.get_text():
            text.set_parse_math(is_math(text.get_text()))


def _legend_height(entries: int) -> float:
    return 0.32 + 0.18 * -(-entries // _LEGEND_COLUMNS)


def line_key(colour: str, label: str, **style: Any) -> Line2D:
    """A legend entry: a line."""
    return Line2D([], [], color=colour, label=label, **style)


def dot_key(colour: str, label: str, *, hollow: bool = False, marker: str = "o", size: float = 5.0) -> Line2D:
    """A legend entry: a marker, of which only the edge is drawn if it is hollow."""
    face = "white" if hollow else colour
    return Line2D([], [], color=colour, label=label, ls="none", marker=marker, ms=size, mfc=face)


def band_key(colour: str, label: str, alpha: float = 0.4) -> Line2D:
    """A legend entry: a band or a bar."""
    return Line2D([], [], color=colour, label=label, lw=6, alpha=alpha)


def baseline_key(title: str, **style: Any) -> list[Line2D]:
    """The legend entry of the baseline model; none without a title."""
    return [line_key(BASELINE, title, ls="--", **style)] if title else []


def warm_up() -> None:
    """Draw what takes long the first time: fonts, symbols, a logarithmic axis, a legend."""
    with styled():
        panels = Panels(1, 1, 1.0, legend=[line_key(MEASURED, r"$d_{\mathrm{M}}$")])
        panels.axes[0].loglog([1, 10], [1, 10])
        panels.figure("", "")
