"""How far the gap shrinks by kind of hold-out: a figure and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mofit.diagnosis.shrinkage import in_percent, labelled_shares
from mofit.report.toolkit.blocks import Block, Column, Figure, Table, Text, words
from mofit.report.toolkit.figures import BASELINE, Panels, dot_key, mode_colour
from mofit.report.toolkit.formatting import THIN, percent

#: Height of a row of the figure and least share that is drawn, as a worse one would hide the others.
_ROW, _LEAST = 0.26, -0.5
_OTHER_RECORDS = (
    "Groups show how far the effect can be extrapolated within this campaign. Records of another kind may shrink less: "
    "keep some out with --hold-out to measure it."
)


def hold_out_blocks(shrinkage: Mapping[str, Any] | None) -> list[Block]:
    """The shares of all kinds with their intervals; nothing where they are not reported."""
    if shrinkage is None:
        return []
    blocks: list[Block] = [_figure(shrinkage), _table(shrinkage)]
    if shrinkage["kind"] != "records":
        blocks.append(Text(_OTHER_RECORDS))
    return blocks


def _figure(shrinkage: Mapping[str, Any]) -> Figure:
    rows = [
        (label, one, colour)
        for kind in shrinkage["kinds"]
        for colour in [mode_colour(0) if kind is shrinkage["kinds"][-1] else BASELINE]
        for label, one in labelled_shares([kind])
        if not one.get("ran_away", False)
    ]
    legend = [
        dot_key(mode_colour(0), "most demanding kind of hold-out: the headline"),
        dot_key(BASELINE, "other kinds"),
    ]
    panels = Panels(1, 1, 0.3 + _ROW * len(rows), legend=legend, margin=(2.6, 0.5, 0.2))
    axes = panels.axes[0]
    for place, (_, one, colour) in enumerate(rows):
        share, low, high = (100 * max(one[key], _LEAST) for key in ("share", "low", "high"))
        axes.errorbar(share, place, xerr=[[share - low], [high - share]], color=colour, ls="none", marker="o", ms=4)
    axes.set_yticks(range(len(rows)), [label for label, _, _ in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]), right=100.5)
    axes.set_xlabel("share of the gap removed (%)")
    return panels.figure(
        "Share of the gap removed by kind of hold-out",
        "Share of the squared gap that the effect removes where it was left out of the fit, with 90 % intervals.",
        good="all kinds are near 100 %.",
        bad="the headline lies far below the others: the law does not hold there.",
        finding=_range(rows),
    )


def _range(rows: Sequence[tuple[str, Mapping[str, Any], str]]) -> str:
    if not rows:
        return ""
    low, high = (choose(rows, key=lambda row: row[1]["share"]) for choose in (min, max))
    least, most = (f"{in_percent(row[1]['share'])}{THIN}% ({row[0]})" for row in (low, high))
    return f"The effect removes {least} of the gap." if low is high else f"Between {least} and {most} of the gap go."


def _table(shrinkage: Mapping[str, Any]) -> Table:
    rows = list(labelled_shares(shrinkage["kinds"]))
    cells = [
        [f"{in_percent(one[key])}{THIN}%" if not one.get("ran_away", False) else "–" for _, one in rows]
        for key in ("share", "low", "high")
    ]
    observed = [percent(one["observed"]) if "observed" in one else "" for _, one in rows]
    columns = [words("left out of the fit", [label for label, _ in rows])]
    columns += [Column(head, own) for head, own in zip(("removed", "5 %", "95 %"), cells, strict=True)]
    return Table([*columns, Column("against the measured samples", observed)])
