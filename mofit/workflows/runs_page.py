"""The start page of a folder of runs: what was run, verdicts, errors beside the noise, and runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Figure,
    Raw,
    Section,
    Table,
    Text,
    badge,
    bullets,
    cards,
    words,
    wrapped,
)
from mofit.report.toolkit.description import keyed
from mofit.report.toolkit.figures import FLOOR, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import (
    compact,
    display_unit,
    number,
    percent,
    plus_minus,
    symbol,
    unit_text,
    whole_percent,
)
from mofit.report.toolkit.page import draw_sections, write_page
from mofit.workflows.runs import RunEntry, mean

PAGE = "runs.html"
_WORDS = {"good": "good", "fair": "with reservations", "bad": "bad"}
_MOST = 12
"""Runs that stand side by side: the latest."""


def write_runs(entries: Sequence[RunEntry], folder: Path) -> Path:
    """Write the start page into the folder of the runs; it is returned."""
    sections = draw_sections([_runs, _beside], list(entries))
    counted = f"{len(entries)} run{'' if len(entries) == 1 else 's'}"
    return write_page(folder / PAGE, f"Runs in {folder.resolve().name}", counted, sections)


def _runs(entries: Sequence[RunEntry]) -> Section:
    """Verdicts first, then errors, then what to know of each."""
    grades = [entry.grade for entry in entries]
    counted = [(str(grades.count(grade)), text) for grade, text in _WORDS.items() if grade in grades]
    blocks: list[Block] = [cards(counted), _table(entries)]
    if warned := [entry for entry in entries if entry.warnings]:
        lines = [Markup("<b>{}</b>: {}").format(entry.name, " ".join(entry.warnings)) for entry in warned]
        blocks.append(bullets(lines, Markup("<b>Warnings of the runs</b>")))
    if sum(bool(entry.nrmsd) for entry in entries) > 1:
        blocks.append(_errors([entry for entry in entries if entry.nrmsd]))
    return Section("runs", "Runs", blocks)


def _table(entries: Sequence[RunEntry]) -> Table:
    link = Markup('<a href="{}">{}</a>')
    removed = ["–" if entry.removed is None else whole_percent(entry.removed, 1) for entry in entries]
    return Table(
        [
            words("Run", [link.format(entry.page, entry.name) if entry.page else entry.name for entry in entries]),
            words("", [badge(_WORDS[entry.grade], entry.grade) for entry in entries]),
            words("Verdict", [wrapped(entry.verdict) for entry in entries]),
            Column("NRMSD", [percent(mean(entry.nrmsd)) for entry in entries]),
            Column("Noise floor", [percent(mean(entry.noise_floor)) for entry in entries]),
            Column("Gap", [_gap(entry) for entry in entries]),
            Column("Gap removed", removed),
            Column("Warnings", [str(len(entry.warnings)) for entry in entries]),
            words("Command", [entry.what for entry in entries]),
            words("Model", [entry.model for entry in entries]),
            words("Campaign", [wrapped(entry.campaign) for entry in entries]),
            words("Made", [entry.created[:16].replace("T", " ") for entry in entries]),
        ],
        "NRMSD and noise floor: mean over the tests. Gap: root mean square beyond the noise.",
    )


def _gap(entry: RunEntry) -> str:
    if entry.gap is None:
        return "–"
    unit = display_unit(entry.gap_unit, entry.gap)
    return f"{number(unit.factor * entry.gap)} {unit.name}"


def _errors(entries: Sequence[RunEntry]) -> Figure:
    legend = [dot_key(mode_colour(0), "NRMSD"), line_key(FLOOR, "noise floor", lw=2)]
    panels = Panels(1, 1, 0.26 * len(entries) + 0.3, legend=legend, margin=(3.0, 0.5, 0.2))
    axes, rows = panels.axes[0], np.arange(len(entries))
    axes.vlines([100 * mean(e.noise_floor) for e in entries], rows - 0.35, rows + 0.35, color=FLOOR, lw=2)
    (dots,) = axes.plot([100 * mean(e.nrmsd) for e in entries], rows, color=mode_colour(0), ls="none", marker="o")
    keyed(dots, run=[entry.name for entry in entries])
    axes.set_yticks(rows, [entry.name for entry in entries])
    axes.set_ylim(len(entries) - 0.4, -0.6)
    axes.set_xlim(left=0)
    axes.set_xlabel("NRMSD (%), mean over the tests")
    least = min(entries, key=lambda entry: mean(entry.nrmsd))
    return panels.figure(
        "NRMSD of every run beside its noise floor",
        "Mean NRMSD over the tests of each run, and the least that any model can reach on its data.",
        good="the dot lies on the bar.",
        bad="the dot lies far right of it: the model lacks something.",
        finding=f"The least error has {least.name}: {percent(mean(least.nrmsd))}.",
    )


def _beside(entries: Sequence[RunEntry]) -> Section | None:
    """A column per run: parameters, errors, gaps; the page lets choose two and shows how far they lie apart."""
    shown = [entry for entry in entries if entry.parameters]
    shown = sorted(shown, key=lambda entry: entry.created, reverse=True)[:_MOST]
    if len(shown) < 2:
        return None
    names = list(dict.fromkeys(name for entry in shown for name in entry.parameters))
    tests = list(dict.fromkeys(name for entry in shown for name in entry.nrmsd))
    units = {name: one.unit for entry in shown for name, one in entry.parameters.items()}
    heads = [*map(symbol, names), *(f"NRMSD of {test}" for test in tests), "Gap", "Gap removed"]
    kinds = [*(unit_text(units[name]) for name in names), *[""] * (len(tests) + 2)]
    columns = [words("Quantity", heads), words("Unit", kinds)]
    for entry in shown:
        cells = [_estimate(entry, name) for name in names]
        cells += [_number(entry.nrmsd.get(test), percent) for test in tests]
        cells += [_gap(entry), _number(entry.removed, lambda value: whole_percent(value, 1))]
        columns.append(Column(entry.name, cells))
    table = Table([*columns, words(Markup('<span class="apart">Apart</span>'), [""] * len(heads))])
    text = Text(
        "Apart: the difference of two runs in their standard deviation (sd, the root of the sum of both squares); of "
        "an NRMSD in per cent of the first."
    )
    return Section("beside", "Side by side", [text, Raw(Markup('<div class="abreast"></div>')), table])


def _estimate(entry: RunEntry, name: str) -> Markup | str:
    one = entry.parameters.get(name)
    if one is None:
        return "–"
    text = compact(one.value, 4) if one.sd is None else plus_minus(one.value, one.sd)
    flag = f" ({one.verdict})" if one.verdict and not one.verdict.startswith("identified") else ""
    sd = "" if one.sd is None else f"{one.sd:.6g}"
    return Markup('<span data-value="{:.8g}" data-sd="{}">{}{}</span>').format(one.value, sd, text, flag)


def _number(value: float | None, form: object) -> Markup | str:
    if value is None or not callable(form):
        return "–"
    return Markup('<span data-value="{:.8g}" data-sd="">{}</span>').format(value, form(value))
