"""The page of a batch: the table, then every parameter over the conditions in which the campaigns differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.lines import Line2D

from mofit.batch.tasks import Row
from mofit.labels import CONDITIONS
from mofit.report.display import badge, display_unit, listed, math_symbol, number, percent, symbol, with_sd
from mofit.report.page import Block, Figure, Raw, Section, Table, render
from mofit.report.style import RC, cluster_colour, few_ticks, image_of, legend_above, legend_height, panels
from mofit.result import atomic_path

GRADES = {"done": "good", "not converged": "fair", "failed": "bad"}
#: More combinations of the other conditions than this are not told apart by colour.
_MOST_COLOURS = 8


def write_page(rows: Sequence[Row], what: str, path: Path) -> None:
    """Write the page, self-contained."""
    sections = [_table(rows, what)]
    if what == "identify":
        with mpl.rc_context(RC):
            sections += [_over(rows, condition) for condition in differing(rows)]
    done = sum(row.state == "done" for row in rows)
    text = render("Batch", f"{what} · {done} of {len(rows)} campaigns done", sections)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def differing(rows: Sequence[Row]) -> list[str]:
    """Conditions that have more than one value among the rows with a result."""
    told = [row for row in rows if row.summary]
    names = dict.fromkeys(name for row in told for name in row.conditions)
    return [name for name in names if len({row.conditions[name] for row in told if name in row.conditions}) > 1]


def _table(rows: Sequence[Row], what: str) -> Section:
    conditions = differing(rows)
    units = {
        name: display_unit(
            next(row.units[name] for row in rows if name in row.units),
            [row.conditions[name] for row in rows if name in row.conditions],
        )
        for name in conditions
    }
    names = list(dict.fromkeys(name for row in rows for name in row.parameters))
    found: list[Markup | str] = ["Verdict", "Effects"]
    if what == "identify":
        found = [Markup("{} ({})").format(symbol(name), _unit(rows, name)) for name in names]
    body = []
    for row in rows:
        page = "report.html" if what == "identify" else "diagnosis.html"
        name = Markup('<a href="{0}/{1}">{0}</a>').format(row.name, page) if row.summary else row.name
        cells: list[Markup | str] = [name, badge(row.state, GRADES[row.state])]
        cells += [
            number(row.conditions[name] * units[name].factor, 4) if name in row.conditions else "–"
            for name in conditions
        ]
        cells += _identified(row, names) if what == "identify" else _diagnosed(row)
        body.append(cells)
    heads = [units[name].label(_title(name)) for name in conditions]
    left = [1] if what == "identify" else [1, *range(2 + len(heads), 4 + len(heads))]
    blocks: list[Block] = [Table(["Campaign", "State", *heads, *found], body, left=left)]
    wrong = [row for row in rows if row.message]
    if wrong:
        items = [Markup("<li><b>{}</b>: {}</li>").format(row.name, row.message) for row in wrong]
        blocks.append(Raw(Markup("<ul>{}</ul>").format(Markup("").join(items))))
    return Section("campaigns", "Campaigns", blocks)


def _identified(row: Row, names: Sequence[str]) -> list[Markup | str]:
    mode = row.parameters
    return [
        Markup("{} ± {}").format(
            with_sd(mode[name]["mean"], mode[name]["sd"]), number(mode[name]["sd"], 2)
        ) if name in mode and mode[name]["mean"] is not None and mode[name]["sd"] is not None else "–"
        for name in names
    ]  # fmt: skip


def _diagnosed(row: Row) -> list[Markup | str]:
    effects = [
        Markup("{} ({}, {} {})").format(
            effect["name"], percent(effect["probability"]), number(effect["size"]), effect["unit"]
        )
        for effect in row.summary.get("effects", [])
        if effect["size"] is not None
    ]
    return [row.summary.get("verdict", "–"), listed(effects) if effects else "–"]


def _over(rows: Sequence[Row], condition: str) -> Section:
    """Mean and 90 % interval of every parameter over one condition, coloured by the others."""
    others = [name for name in differing(rows) if name != condition]
    told = [row for row in rows if row.parameters and condition in row.conditions]
    sets = sorted({tuple(row.conditions.get(name, np.nan) for name in others) for row in told})
    coloured = bool(others) and len(sets) <= _MOST_COLOURS
    names = list(dict.fromkeys(name for row in told for name in row.parameters))
    unit = display_unit(told[0].units[condition], [row.conditions[condition] for row in told])
    handles = [
        Line2D([], [], color=cluster_colour(k), marker="o", linestyle="", label=_said(told, others, values))
        for k, values in enumerate(sets if coloured else [])
    ]
    top = 0.3 + (legend_height(len(handles)) if handles else 0.0)
    canvas, axes, _ = panels(len(names), 3, 1.7, margin=(0.75, 0.5, 0.1, top), gap=(0.75, 0.8))
    for panel, name in zip(axes, names, strict=True):
        for row in told:
            entry = row.parameters.get(name)
            if entry is None or entry["mean"] is None:
                continue
            place = sets.index(tuple(row.conditions.get(other, np.nan) for other in others)) if coloured else 0
            x = row.conditions[condition] * unit.factor
            ends = [entry[key] for key in ("q05", "q95") if entry[key] is not None]
            panel.plot([x] * len(ends), ends, color=cluster_colour(place), linewidth=1.0)
            panel.plot([x], [entry["mean"]], "o", color=cluster_colour(place), markersize=3.5)
        panel.set_title(f"{math_symbol(name)} ({_unit(told, name)})")
        panel.set_xlabel(unit.label(_title(condition)))
        few_ticks(panel)
    if handles:
        legend_above(canvas, handles)
    figure = Figure(
        image_of(canvas),
        f"parameters over {_title(condition)}",
        f"Every parameter over the {_title(condition)}: mean and 90 % interval of the most probable mode.",
        good="intervals that follow one smooth trend.",
        bad="points that jump by more than their intervals: another mode, or a test that went wrong.",
    )
    return Section(f"over_{condition}", f"Over the {_title(condition)}", [figure])


def _title(condition: str) -> str:
    return CONDITIONS[condition].title if condition in CONDITIONS else condition.replace("_", " ")


def _unit(rows: Sequence[Row], name: str) -> str:
    unit = next(mode[name]["unit"] for mode in (row.parameters for row in rows) if name in mode)
    return "–" if unit == "1" else str(unit)


def _said(rows: Sequence[Row], names: Sequence[str], values: Sequence[float]) -> str:
    """``load 3.2 kN, pressure 2.4 bar``."""
    words = []
    for name, value in zip(names, values, strict=True):
        unit = display_unit(next(row.units[name] for row in rows if name in row.units), [value])
        words.append(f"{_title(name)} {number(value * unit.factor)} {unit.name}")
    return ", ".join(words)
