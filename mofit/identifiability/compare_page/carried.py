"""Which test carries what is known of a parameter, where several are identified together."""

from __future__ import annotations

from markupsafe import Markup

from mofit.identifiability.comparison import Carried, Comparison
from mofit.identifiability.sentences import NOTHING
from mofit.report.display import number, percent, symbol
from mofit.report.page import Block, Section, Table, tabs
from mofit.report.style import CLUSTER_COLOURS


def carried_section(comparison: Comparison) -> Section | None:
    """A table per procedure of several tests."""
    if not comparison.carried:
        return None
    panes: dict[str, list[Block]] = {
        each.procedure: [_table(each, comparison.parameters)] for each in comparison.carried
    }
    return Section("carried", "Which test carries what", tabs(panes))


def _table(carried: Carried, names: tuple[str, ...]) -> Table:
    columns: list[Markup | str] = ["Test"]
    for name in names:
        columns += [symbol(name), Markup("{}: sd without").format(symbol(name))]
    rows: list[list[Markup | str]] = []
    for t, test in enumerate(carried.tests):
        row: list[Markup | str] = [test]
        for k in range(len(names)):
            row += [_bar(float(carried.share[t, k])), f"×{number(float(carried.without[t, k]), 3)}"]
        rows.append(row)
    for source, shares in (
        ("calibration", carried.calibration),
        ("bounds", 1 - carried.share.sum(axis=0) - carried.calibration),
    ):
        rows.append([source, *(cell for own in shares for cell in (percent(max(0.0, float(own))), ""))])
    return Table(
        columns,
        rows,
        "Share of what is known of each parameter that a test carries, after all that other parameters can explain is "
        f"taken out (below {100 * NOTHING:g} %: next to nothing); and by how much the standard deviation grows without "
        "that test.",
        left=[1 + 2 * k for k in range(len(names))],
    )


def _bar(share: float) -> Markup:
    style = f"display:inline-block;height:0.7em;width:{min(max(share, 0.0), 1.0) * 8:.2f}em;background:"
    return Markup('<span style="{}{};margin-right:0.4em"></span>{}').format(style, CLUSTER_COLOURS[0], percent(share))
