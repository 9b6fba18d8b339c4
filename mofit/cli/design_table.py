"""A design as a person sees it in the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from mofit.identifiability.design_text import criterion_text, settings_text, value_text
from mofit.terminal import terminal_console


def show_design(told: Mapping[str, Any]) -> None:
    """The programme first, then what it gives, then the rest.

    Parameters
    ----------
    told
        What ``--json`` prints.
    """
    out = terminal_console()
    table = Table("run next", "kind", "settings", box=SIMPLE, padding=(0, 1, 0, 0))
    for heading in ("times", "time"):
        table.add_column(heading, justify="right")
    for test in told["programme"]:
        table.add_row(test["name"], test["kind"], settings_text(test), str(test["times"]), f"{test['seconds']:.0f} s")
    out.print(table)
    spread = Table("parameter", box=SIMPLE, padding=(0, 1, 0, 0))
    for heading in ("sd before", "sd after", "unit", "before", "after"):
        spread.add_column(heading, justify="right" if heading != "unit" else "left")
    spread.add_column("verdict after")
    for name, entry in told["parameters"].items():
        spread.add_row(
            name, f"{entry['sd_before']:.3g}", f"{entry['sd']:.3g}", entry["unit"],
            f"{100 * entry['relative_sd_before']:.2g} %", f"{100 * entry['relative_sd']:.2g} %", entry["verdict"],
        )  # fmt: skip
    out.print(spread)
    out.print(criterion_text(told), highlight=False)
    best = Table("best alone", box=SIMPLE, padding=(0, 1, 0, 0))
    best.add_column("time", justify="right")
    best.add_column("criterion", justify="right")
    for test in told["singles"][:5]:
        best.add_row(test["name"], f"{test['seconds']:.0f} s", value_text(told, test["value"]))
    out.print(best)
    refused = ", ".join(f"{number} by {reason}" for reason, number in told["refused"].items())
    out.print(f"{told['candidates']} candidates" + (f"; refused: {refused}" if refused else "") + ".", highlight=False)
    for sentence in (*told["notes"], *told["lost"]):
        out.print(sentence, highlight=False)
