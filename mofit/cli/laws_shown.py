"""The laws of a run in the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.box import SIMPLE
from rich.table import Table


def laws_table(found: Mapping[str, Any]) -> Table:
    """The law of every parameter over every condition, and how much less evidence the next best has."""
    table = Table(title="Laws over conditions", box=SIMPLE, padding=(0, 1, 0, 0))
    for head in ("parameter", "over", "law", "next best"):
        table.add_column(head, no_wrap=True)
    table.add_column("log evidence", justify="right")
    for law in found["laws"]:
        others = {name: value for name, value in law["log_evidence"].items() if name != law["law"]}
        best = max(others, key=lambda name: others[name], default=None)
        second = ("–", "") if best is None else (best, f"{others[best]:.3g}")
        table.add_row(law["parameter"], law["condition"], law["law"], *second)
    return table
