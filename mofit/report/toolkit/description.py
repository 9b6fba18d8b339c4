"""What the axes of a figure show, as plain values: a page's script draws the same figure from them, to be explored.

Units are those of the axes. A *key* says what a part of a figure belongs to, ``{"test": "sine_2Hz"}``: whoever chooses
that test on the page sees its parts in all figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex, to_rgba
from matplotlib.container import BarContainer
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle, StepPatch
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from matplotlib.typing import ColorType
from numpy.typing import ArrayLike

from mofit._typing import FloatArray
from mofit.report.toolkit.formatting import html_of_math

Parts = list[dict[str, Any]]
"""Parts of a panel: each a line, band, bars, cells or texts."""

_SYMBOLS = {"o": "circle", ".": "circle", "s": "square", "*": "star", "D": "diamond", "^": "triangle-up", "x": "x"}
_SHADES = 9
"""Colours that stand for a colour map."""
_BAND_KEY = 6.0
"""Line width from which an entry of a legend is a band."""
_BUNDLE = "bundle"


def keyed(artist: Artist, **keys: Any) -> None:
    """Say what an artist belongs to, ``test="sine_2Hz"``; a sequence gives a key to every point of it."""
    artist.set_gid(json.dumps(keys))


def test_of(objective: str) -> str:
    """The test of a pair ``test / output``, or the test itself; no test's name holds a ``/``."""
    return objective.partition(" / ")[0]


def bundled(lines: LineCollection) -> None:
    """Say that the lines are a bundle, which a box across them thins out: parallel coordinates."""
    lines.set_gid(_BUNDLE)


def keys_of(artist: Artist) -> dict[str, Any]:
    """What an artist was said to belong to."""
    gid = artist.get_gid() or ""
    return dict(json.loads(gid)) if gid.startswith("{") else {}


def described(axes: Axes, legend: Sequence[Line2D] = ()) -> dict[str, Any]:
    """Axes, parts and keys of a panel; parts without a label have the name of the entry of the legend that is alike."""
    parts: Parts = []
    for collection in axes.collections:
        parts += _collection(collection)
    parts += [_cells(image) for image in axes.images]
    for patch in axes.patches:
        parts += _patch(axes, patch)
    parts += [_bars(container) for container in axes.containers if isinstance(container, BarContainer)]
    parts += [_line(axes, line) for line in axes.lines]
    for part in parts:
        part["name"] = part["name"] or _name(part, legend)
    if texts := [text for text in axes.texts if text.get_text()]:
        parts.append(_texts(axes, texts))
    return {
        "title": html_of_math(axes.get_title(loc="left") or axes.get_title()),
        "x": _axis(axes.xaxis, axes.get_xlim()),
        "y": _axis(axes.yaxis, axes.get_ylim()),
        "parts": parts,
        "keys": keys_of(axes),
    }


def legend_entries(legend: Sequence[Line2D]) -> list[dict[str, Any]]:
    """Name, colour and look (line, dots, band) of every entry."""
    return [
        {"name": str(entry.get_label()), "html": html_of_math(str(entry.get_label()))} | _look(entry)
        for entry in legend
    ]


def offers(described_figure: Mapping[str, Any]) -> dict[str, list[str]]:
    """What can be chosen in a figure: the values of every kind of key, in the order of its parts."""
    found: dict[str, dict[str, None]] = {}
    for panel in described_figure["panels"]:
        for row in filter(None, (panel, panel.get("lower"))):
            for keys in (
                row["keys"],
                row["x"]["keys"],
                row["y"]["keys"],
                *(part.get("keys", {}) for part in row["parts"]),
            ):
                for kind, values in keys.items():
                    found.setdefault(kind, {}).update(dict.fromkeys([values] if isinstance(values, str) else values))
    return {kind: list(values) for kind, values in found.items()}


def rounded(values: ArrayLike) -> list[Any]:
    """Values to six digits, by place; None where one is not finite."""
    array = np.asarray(values, dtype=float)
    if array.ndim > 1:
        return [rounded(row) for row in array]
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in array.tolist()]


def _hex(colour: ColorType) -> str:
    return to_hex(colour, keep_alpha=False)


def _look(line: Line2D) -> dict[str, Any]:
    bare = line.get_linestyle() in ("None", "none", "")
    dots = bare and line.get_marker() not in (None, "None", "")
    band = not dots and line.get_linewidth() >= _BAND_KEY
    return {
        "look": "dots" if dots else "band" if band else "line",
        "colour": _hex(line.get_markeredgecolor() if dots else line.get_color()),
        "dash": "" if bare else _dash(line.get_linestyle()),
        "alpha": line.get_alpha() or 1.0,
    }


def _dash(style: Any) -> str:
    return {"--": "dash", ":": "dot", "-.": "dashdot"}.get(str(style), "solid")


def _name(part: Mapping[str, Any], legend: Sequence[Line2D]) -> str:
    """The name of the only entry of the part's colour, and look or dash where there are several."""
    entries = [entry for entry in legend_entries(legend) if entry["colour"] == part.get("colour")]
    for feature in ("look", "dash"):
        if len(entries) > 1:
            entries = [entry for entry in entries if entry[feature] == part.get(feature)] or entries
    return entries[0]["name"] if len(entries) == 1 else ""


def _labelled(artist: Any) -> str:
    label = "" if artist is None else str(artist.get_label() or "")
    return "" if label.startswith("_") else label


def _part(kind: str, artist: Any, **values: Any) -> dict[str, Any]:
    keys = keys_of(artist) if isinstance(artist, Artist) else {}
    return {"kind": kind, "name": _labelled(artist), "alpha": 1.0, **({"keys": keys} if keys else {}), **values}


def _line(axes: Axes, line: Line2D) -> dict[str, Any]:
    """A curve or dots; a line right across the panel gives its place on one axis only."""
    across = line.get_transform().contains_branch_seperately(axes.transData)
    x, y = (rounded(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)) for values in line.get_data(orig=False))
    look, marker = _look(line), str(line.get_marker())
    if not all(across):
        return _part("across", line, **look, **({"x": x[0]} if across[0] else {"y": y[0]}))
    dots = {}
    if marker in _SYMBOLS:
        hollow = str(line.get_markerfacecolor()) in ("none", "white")
        colour = _hex(line.get_markeredgecolor() if hollow else line.get_markerfacecolor())
        size = line.get_markersize() * (0.7 if marker == "." else 1.0)
        dots = {"symbol": _SYMBOLS[marker] + ("-open" if hollow else ""), "size": size, "colour": colour}
        look["colour"] = colour if look["look"] == "dots" else look["colour"]
    return _part("line", line, **look, x=x, y=y, width=line.get_linewidth(), dots=dots)


def _collection(found: Any) -> Parts:
    if isinstance(found, LineCollection):
        return _segments(found)
    if isinstance(found, QuadMesh):
        corners = np.asarray(found.get_coordinates())
        return [_cells(found, corners[0, :, 0], corners[:, 0, 1])]
    if isinstance(found, PathCollection):
        found.update_scalarmappable()
        x, y = np.asarray(found.get_offsets(), dtype=float).T
        colours = [_hex(tuple(colour)) for colour in np.atleast_2d(np.asarray(found.get_facecolor()))]
        dots = {"symbol": "circle", "size": float(np.sqrt(found.get_sizes()[0])), "colour": colours}
        look = {"look": "dots", "colour": colours[0], "width": 0, "dash": ""}
        return [_part("line", found, x=rounded(x), y=rounded(y), **look, dots=dots)]
    if isinstance(found, PolyCollection):
        return [_polygon(found, [path.vertices for path in found.get_paths()])]
    return []


def _polygon(artist: Any, outlines: Sequence[Any]) -> dict[str, Any]:
    x, y = _joined(outlines)
    colour = np.atleast_2d(artist.get_facecolor())[0]
    return _part("band", artist, look="band", x=x, y=y, colour=_hex(tuple(colour)), alpha=float(colour[3]))


def _joined(pieces: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Pieces (n, 2) one after another with a gap between them."""
    gap = np.full((1, 2), np.nan)
    whole = np.concatenate([gap if k % 2 else pieces[k // 2] for k in range(2 * len(pieces) - 1)] or [gap])
    return rounded(whole[:, 0]), rounded(whole[:, 1])


def _segments(found: LineCollection) -> Parts:
    """All pieces as one line."""
    pieces = [np.asarray(piece) for piece in found.get_segments() if len(piece)]  # a bar without a value is empty
    x, y = _joined(pieces)
    found.update_scalarmappable()
    colour = np.atleast_2d(found.get_edgecolor())
    middle = _hex(tuple(colour[len(colour) // 2])) if len(colour) else "#000000"
    width = float(np.atleast_1d(found.get_linewidth())[0])
    bundle = {"bundle": 1 + len(pieces[0])} if found.get_gid() == _BUNDLE else {}
    return [_part("line", found, x=x, y=y, colour=middle, width=width, dash="solid", dots={}, **bundle)]


def _cells(found: AxesImage | QuadMesh, x: ArrayLike | None = None, y: ArrayLike | None = None) -> dict[str, Any]:
    """Cells of a heat map, by their centres or edges."""
    values: FloatArray = np.ma.filled(np.ma.asarray(found.get_array(), dtype=float), np.nan)
    rows, columns = values.shape[:2]
    low, high = found.get_clim()
    shades = [[k / (_SHADES - 1), _hex(found.get_cmap()(k / (_SHADES - 1)))] for k in range(_SHADES)]
    x, y = (np.arange(n) if edges is None else edges for edges, n in ((x, columns), (y, rows)))
    return _part("cells", found, x=rounded(x), y=rounded(y), z=rounded(values), shades=shades, low=low, high=high)


def _patch(axes: Axes, patch: Any) -> Parts:
    if isinstance(patch, StepPatch):
        values, edges, _ = patch.get_data()
        colour = _hex(patch.get_facecolor() if patch.get_fill() else patch.get_edgecolor())
        x, y = np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(values, 2), [0.0]])
        if patch.get_fill():
            return [_part("band", patch, x=rounded(x), y=rounded(y), colour=colour, alpha=patch.get_alpha() or 1.0)]
        width = float(patch.get_linewidth())
        return [_part("line", patch, x=rounded(x), y=rounded(y), colour=colour, width=width, dash="solid", dots={})]
    in_bars = any(patch in container for container in axes.containers if isinstance(container, BarContainer))
    if in_bars or not isinstance(patch, Rectangle | Polygon):
        return []
    corners = patch.get_path().vertices if isinstance(patch, Polygon) else patch.get_corners()
    inside = patch.get_transform().contains_branch_seperately(axes.transData)
    look = {"look": "band", "colour": _hex(patch.get_facecolor()), "alpha": to_rgba(patch.get_facecolor())[3]}
    ends = [sorted({float(c) for c in np.asarray(corners)[:, k]}) for k in (0, 1)]
    if isinstance(patch, Rectangle) and not all(inside):
        bounds = patch.get_bbox()
        ends = [[bounds.x0, bounds.x1], [bounds.y0, bounds.y1]]
    if not all(inside):
        return [_part("stripe", patch, **look, **({"x": ends[0]} if inside[0] else {"y": ends[1]}))]
    return [_polygon(patch, [corners])]


def _bars(container: BarContainer) -> dict[str, Any]:
    """Bars by place, length, base and width."""
    boxes = [bar.get_bbox() for bar in container.patches]
    flat = container.orientation == "horizontal"
    first = container.patches[0] if container.patches else None
    colours = [_hex(bar.get_facecolor()) for bar in container.patches]
    return _part(
        "bars",
        first,
        look="band",
        name=_labelled(container),
        colour=colours[0] if colours else "",
        colours=colours,
        alpha=to_rgba(first.get_facecolor())[3] if first else 1.0,
        flat=flat,
        at=rounded([(box.y0 + box.y1) / 2 if flat else (box.x0 + box.x1) / 2 for box in boxes]),
        length=rounded([box.width if flat else box.height for box in boxes]),
        base=rounded([box.x0 if flat else box.y0 for box in boxes]),
        width=rounded([box.height if flat else box.width for box in boxes]),
    )  # fmt: skip


def _texts(axes: Axes, texts: Sequence[Any]) -> dict[str, Any]:
    places = [text.get_transform().transform(text.get_position()) for text in texts]
    x, y = axes.transData.inverted().transform(places).T
    written = [html_of_math(text.get_text()) for text in texts]
    bold = [f"<b>{text}</b>" if one.get_weight() == "bold" else text for one, text in zip(texts, written, strict=True)]
    return _part(
        "texts", None, name="", x=rounded(x), y=rounded(y), text=bold, colours=[_hex(t.get_color()) for t in texts]
    )


def _axis(axis: Axis, limits: tuple[float, float]) -> dict[str, Any]:
    """Label, scale, limits, and ticks where they are set."""
    locator = axis.get_major_locator()
    ticks: dict[str, Any] | None = None
    if isinstance(locator, NullLocator):
        ticks = {"values": [], "texts": []}
    elif not isinstance(locator, MaxNLocator | LogLocator):
        places = np.asarray(axis.get_majorticklocs(), dtype=float)
        texts = axis.get_major_formatter().format_ticks(places.tolist())
        ticks = {"values": rounded(places), "texts": [html_of_math(text).replace("\n", "<br>") for text in texts]}
    return {
        "title": html_of_math(axis.get_label_text()),
        "log": axis.get_scale() == "log",
        "range": rounded(limits),
        "ticks": ticks,
        "keys": keys_of(axis),
    }
