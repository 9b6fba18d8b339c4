"""The rows of a batch: a CSV table, and a page with every parameter over the conditions that differ."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit.quantities import CONDITIONS
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, badge, bullets, words
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import Panels, dot_key, mode_colour
from mofit.report.toolkit.formatting import (
    Unit,
    display_unit,
    listed,
    number,
    parameter_head,
    parameter_label,
    percent,
    plus_minus,
    symbol,
)
from mofit.report.toolkit.page import draw_sections
from mofit.report.toolkit.page import write_page as write_sections
from mofit.runtime.files import atomic_path
from mofit.workflows.batch_tasks import Row

GRADES = {"done": "good", "not converged": "fair", "failed": "bad"}
#: More combinations of the other conditions than this share one colour.
_MOST_COLOURS = 8


def write_page(rows: Sequence[Row], what: str, path: Path) -> None:
    """Write the page, self-contained."""
    makers = [partial(_campaigns, what=what)]
    if what == "identify":
        makers += [partial(_over, condition=condition) for condition in differing(rows)]
    done = sum(row.state == "done" for row in rows)
    subtitle = f"{what} · {done} of {len(rows)} campaigns done"
    write_sections(path, "Batch", subtitle, draw_sections(makers, rows))


def differing(rows: Sequence[Row]) -> list[str]:
    """Conditions with more than one value among the rows with a result."""
    finished = [row for row in rows if row.summary]
    names = dict.fromkeys(name for row in finished for name in row.conditions)
    return [name for name in names if len({row.conditions[name] for row in finished if name in row.conditions}) > 1]


def parameter_units(rows: Sequence[Row]) -> dict[str, str]:
    """Unit of every identified parameter."""
    return {name: str(entry["unit"]) for row in rows for name, entry in row.parameters.items()}


def _campaigns(rows: Sequence[Row], what: str) -> Section:
    page = "report.html" if what == "identify" else "diagnosis.html"
    link = Markup('<a href="{0}/{1}">{0}</a>')
    columns = [
        words("Campaign", [link.format(row.name, page) if row.summary else row.name for row in rows]),
        words("State", [badge(row.state, GRADES[row.state]) for row in rows]),
    ]
    for name in differing(rows):
        unit = _unit_of(rows, name)
        cells = [number(row.conditions[name] * unit.factor, 4) if name in row.conditions else "–" for row in rows]
        columns.append(Column(unit.label(_title(name)), cells))
    columns += [*_outcomes(rows), *_estimates(rows)] if what == "identify" else [*_effects(rows), *_gaps(rows)]
    blocks: list[Block] = [Table(columns)]
    if issues := [row for row in rows if row.message]:
        blocks.append(bullets(Markup("<b>{}</b>: {}").format(row.name, row.message) for row in issues))
    return Section("campaigns", "Campaigns", blocks)


def _outcomes(rows: Sequence[Row]) -> list[Column]:
    """How many parameters are identified, which are at a bound, and the mean error beside the noise."""

    def identified(row: Row) -> str:
        verdicts = [entry["verdict"] for entry in row.parameters.values()]
        return (
            f"{sum(verdict.startswith('identified') for verdict in verdicts)} of {len(verdicts)}" if verdicts else "–"
        )

    def at_bound(row: Row) -> Markup | str:
        return listed([symbol(name) for name, entry in row.parameters.items() if entry.get("at_bound")]) or "–"

    def errors(row: Row) -> Mapping[str, float | None]:
        return dict(row.best["nrmsd"]) if row.best else {}

    return [
        Column("Identified", list(map(identified, rows))),
        words("At a bound", list(map(at_bound, rows))),
        Column("NRMSD", [_mean_percent(errors(row)) for row in rows]),
        Column("Noise floor", [_mean_percent(row.summary.get("noise_floor", {})) for row in rows]),
    ]


def _gaps(rows: Sequence[Row]) -> list[Column]:
    """The gap that was found, and the noise floor, as a mean over the tests."""

    def gap(row: Row) -> str:
        where = row.summary.get("where")
        if not where:
            return "–"
        unit = display_unit(where["unit"], where["gap"])
        return f"{number(unit.factor * where['gap'])} {unit.name}"

    floors = [_mean_percent(row.summary.get("noise_floor", {})) for row in rows]
    return [Column("Gap", list(map(gap, rows))), Column("Noise floor", floors)]


def _mean_percent(values: Mapping[str, float | None]) -> str:
    known = [value for value in values.values() if value is not None]
    return percent(float(np.mean(known))) if known else "–"


def _estimates(rows: Sequence[Row]) -> list[Column]:
    def cell(entry: dict[str, Any] | None) -> str:
        known = entry is not None and entry["mean"] is not None and entry["sd"] is not None
        return plus_minus(entry["mean"], entry["sd"]) if entry is not None and known else "–"

    return [
        Column(parameter_head(name, unit), [cell(row.parameters.get(name)) for row in rows])
        for name, unit in parameter_units(rows).items()
    ]


def _effects(rows: Sequence[Row]) -> list[Column]:
    def found(row: Row) -> Markup | str:
        effects = [
            Markup("{} ({}, {} {})").format(
                effect["name"], percent(effect["probability"]), number(effect["size"]), effect["unit"]
            )
            for effect in row.summary.get("effects", [])
            if effect["size"] is not None
        ]
        return listed(effects) if effects else "–"

    verdicts = [row.summary.get("verdict", "–") for row in rows]
    return [words("Verdict", verdicts), words("Effects", map(found, rows))]


def _over(rows: Sequence[Row], condition: str) -> Section:
    """Mean and 90 % interval of every parameter over one condition, coloured by the others."""
    title, others = _title(condition), [name for name in differing(rows) if name != condition]
    shown = [row for row in rows if row.parameters and condition in row.conditions]

    def combination(row: Row) -> tuple[float, ...]:
        return tuple(row.conditions.get(name, np.nan) for name in others)

    combinations = sorted(set(map(combination, shown)))
    if not others or len(combinations) > _MOST_COLOURS:
        combinations = []
    colours = {values: mode_colour(k) for k, values in enumerate(combinations)}
    keys = [dot_key(colour, _described(shown, others, values)) for values, colour in colours.items()]
    units, unit = parameter_units(shown), _unit_of(shown, condition)
    places = [row.conditions[condition] for row in shown]
    panels = Panels(len(units), 3, 1.7, legend=keys, gap=(0.75, 0.8))
    for axes, (name, own_unit) in zip(panels.axes, units.items(), strict=True):
        for row in shown:
            entry = row.parameters.get(name)
            if entry is None or entry["mean"] is None:
                continue
            colour, x = colours.get(combination(row), mode_colour(0)), row.conditions[condition] * unit.factor
            ends = [entry[key] for key in ("q05", "q95") if entry[key] is not None]
            (bar,) = axes.plot([x] * len(ends), ends, color=colour, linewidth=1.0)
            (dot,) = axes.plot([x], [entry["mean"]], "o", color=colour, markersize=3.5)
            keyed(bar, campaign=row.name)
            keyed(dot, campaign=[row.name])
        axes.set_title(parameter_label(name, own_unit))
        axes.set_xlabel(unit.label(title))
        few_ticks(axes)
    figure: Figure = panels.figure(
        f"parameters over {title}",
        f"Every parameter over the {title}: mean and 90 % interval of the most probable mode.",
        good="intervals that follow one smooth trend.",
        bad="points that jump by more than their intervals: another mode, or a faulty test.",
        finding=f"{len(shown)} campaigns over the {title}, from {_described(shown, [condition], [min(places)])} to "
        f"{_described(shown, [condition], [max(places)])}.",
    )
    return Section(f"over_{condition}", f"Over the {title}", [figure])


def _title(condition: str) -> str:
    return CONDITIONS[condition].title if condition in CONDITIONS else condition.replace("_", " ")


def _unit_of(rows: Sequence[Row], condition: str) -> Unit:
    unit = next(row.units[condition] for row in rows if condition in row.units)
    return display_unit(unit, [row.conditions[condition] for row in rows if condition in row.conditions])


def _described(rows: Sequence[Row], names: Sequence[str], values: Sequence[float]) -> str:
    """``load 3.2 kN, pressure 2.4 bar``."""
    found = []
    for name, value in zip(names, values, strict=True):
        unit = display_unit(next(row.units[name] for row in rows if name in row.units), [value])
        found.append(f"{_title(name)} {number(value * unit.factor)} {unit.name}")
    return ", ".join(found)


def write_table(rows: Sequence[Row], what: str, path: Path) -> None:
    """Write the rows as CSV in SI units.

    Name, state and conditions come first, then the findings. Of an identification: mean, standard deviation, 90 %
    interval and verdict of every parameter in the most probable mode. Of a diagnosis: the verdict, and probability and
    size of every effect.
    """
    flat = [
        {
            "campaign": row.name,
            "state": row.state,
            **{f"{name} [{row.units.get(name, '')}]": value for name, value in row.conditions.items()},
            **(_estimated(row) if what == "identify" else _diagnosed(row)),
            "message": row.message,
        }
        for row in rows
    ]
    names = list(dict.fromkeys(key for row in flat for key in row if key != "message"))
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [*names, "message"], restval="")
        writer.writeheader()
        writer.writerows(flat)


def _estimated(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, entry in row.parameters.items():
        unit = entry["unit"]
        found |= {f"{name} [{unit}]": entry["mean"]}
        found |= {f"{name} {key} [{unit}]": entry[key] for key in ("sd", "q05", "q95")}
        found[f"{name} verdict"] = entry["verdict"]
    return found


def _diagnosed(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {"verdict": row.summary.get("verdict", "")}
    for effect in row.summary.get("effects", []):
        found[f"{effect['name']} probability"] = effect["probability"]
        found[f"{effect['name']} [{effect['unit']}]"] = effect["size"]
    return found
