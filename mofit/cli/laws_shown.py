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


def populations_table(found: Mapping[str, Any]) -> Table:
    """Mean and spread of every parameter over the specimens."""
    table = Table(title="Specimens", box=SIMPLE, padding=(0, 1, 0, 0))
    table.add_column("parameter", no_wrap=True)
    for head in ("mean", "5 %", "95 %", "spread", "5 %", "95 %"):
        table.add_column(head, justify="right")
    table.add_column("unit")
    for name, one in found["populations"].items():
        keys = ("mean", "mean_low", "mean_high", "spread", "spread_low", "spread_high")
        unit = f"{one['unit']}; spread of the logarithm" if one["of_logarithm"] else one["unit"]
        table.add_row(name, *(f"{one[key]:.4g}" for key in keys), unit)
    return table
