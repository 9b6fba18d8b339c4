"""The table that the page begins with: procedures × parameters, coloured."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from mofit.identifiability.comparison import Comparison, Entry
from mofit.identifiability.verdicts import COMBINATION, IDENTIFIABLE, NOT, ONE_SIDED
from mofit.report.display import badge, listed, number, percent, symbol
from mofit.report.page import Block, Raw, Section, Table, Text

GRADES = {IDENTIFIABLE: "good", COMBINATION: "fair", ONE_SIDED: "fair", NOT: "bad"}
"""Colour of every verdict."""


def table_section(comparison: Comparison, mends: Sequence[str]) -> Section:
    """Every parameter in every procedure, then what is to be known of it in sentences."""
    names = comparison.parameters
    rows = [
        [
            row.procedure.name,
            f"{row.seconds:.0f} s",
            *(cell for name in names for cell in _cells(row.entries[name])),
        ]
        for row in comparison.judged
    ]
    columns: list[Markup | str] = ["Procedure", "Time"]
    for name in names:
        columns += [symbol(name), Markup("{}: sd").format(symbol(name)), "after 60 s"]
    left = [2 + 3 * k for k in range(len(names))]
    told = comparison.told[0]
    values = listed([
        Markup("{} = {}&nbsp;{}").format(symbol(name), number(told.values[0, told.source.space.index(name)], 4),
                                         told.source.space[name].unit.replace("1", "") or "")
        for name in names
    ])  # fmt: skip
    caption = Markup(
        "Expected standard deviation in per cent of the value, median over {} parameter sets around {}; and what it "
        "would be after 60&nbsp;s of the procedure. A star: the verdict depends on the parameter set."
    ).format(len(told.values), values)
    blocks: list[Block] = [_banner(comparison), Table(columns, rows, caption, left=left)]
    doubtful = [
        Markup("<li><b>{}</b>: {}</li>").format(row.procedure.name, entry.sentence)
        for row in comparison.judged
        for entry in row.entries.values()
        if entry.verdict != IDENTIFIABLE
    ]
    if doubtful:
        blocks.append(Raw(Markup("<ul>{}</ul>").format(Markup("").join(doubtful))))
    blocks += [Text(text) for text in (*mends, *comparison.notes)]
    return Section("verdicts", "Procedures and parameters", blocks)


def _cells(entry: Entry) -> list[Markup | str]:
    star = "*" if entry.varies else ""
    return [badge(entry.verdict + star, GRADES[entry.verdict]), percent(entry.relative_sd), percent(entry.per_minute)]


def _banner(comparison: Comparison) -> Raw:
    if comparison.lost:
        names = listed([symbol(name) for name in comparison.lost])
        text = Markup("{}: not identifiable from any of these procedures.").format(names)
        return Raw(Markup('<p class="banner bad">{}</p>').format(text))
    best = []
    for name in comparison.parameters:
        row = min(comparison.judged, key=lambda judged: judged.entries[name].relative_sd)
        best.append(
            Markup("{} best from {} (±{})").format(
                symbol(name), row.procedure.name, percent(row.entries[name].relative_sd)
            )
        )
    good = all(any(row.entries[n].verdict == IDENTIFIABLE for row in comparison.judged) for n in comparison.parameters)
    return Raw(Markup('<p class="banner {}">{}.</p>').format("good" if good else "bad", listed(best)))
