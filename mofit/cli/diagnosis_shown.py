"""What a person sees of a diagnosis in the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from mofit.cli.output import table_of, terminal_console


def show_diagnosis(found: Mapping[str, Any], folder: Path) -> None:
    """The conclusion, the effects, the proposed term, and the next experiment."""
    from mofit.diagnosis.effect_file import EFFECT_FILE

    console = terminal_console()
    console.print(found["sentence"], style="bold")
    where = found["where"]
    if where["residuals"]:
        console.print(f"Gap: {where['gap']:.3g} {where['unit']} (root mean square beyond the noise)")
    if where["residuals"] and where["conditions"]:
        console.print(_under_conditions(where))
    if found["effects"]:
        table = table_of("family", "effect", "probability", "size", "5 %", "95 %", "unit", words=("effect", "unit"))
        for effect in found["effects"]:
            sizes = [f"{effect[key]:.4g}" for key in ("size", "size_low", "size_high")]
            table.add_row(effect["family"], effect["name"], f"{effect['probability']:.2f}", *sizes, effect["unit"])
        console.print(table)
    if shrinkage := found["shrinkage"]:
        console.print(shrinkage["sentence"])
        if (shares := _shares(shrinkage["kinds"])).row_count > 1:
            console.print(shares)
        if caveat := shrinkage["caveat"]:
            console.print(caveat)
    if proposed := found["proposed"]:
        table = table_of("proposed term", "value", "5 %", "95 %", "unit", words=("unit",))
        for one in proposed["parameters"]:
            values = [f"{one[key]:.4g}" for key in ("value", "low", "high")]
            table.add_row(f"{one['name']}: {one['description']}", *values, one["unit"])
        console.print(table)
        console.print(f"To go on with it: mofit identify --effect {folder / EFFECT_FILE}")
    elif found["verdict"] in ("partly", "unknown"):
        console.print(f"No term is proposed: {found['proposed_reason']}.")
    if found["next_experiment"]:
        console.print(found["next_experiment"]["sentence"])
    for warning in found["warnings"]:
        console.print(f"warning: {warning}")
    console.print(f"{found['seconds']:.1f} s of processor time; page: {folder / 'diagnosis.html'}")


def _under_conditions(where: Mapping[str, Any]) -> Table:
    table = table_of("condition", "value", "unit", f"gap, {where['unit']}", words=("unit",))
    for one in where["conditions"]:
        table.add_row(one["condition"], f"{one['value']:g}", one["unit"], f"{one['gap']:.3g}")
    return table


def _shares(kinds: Sequence[Mapping[str, Any]]) -> Table:
    """The share of the gap removed, by kind of hold-out, and on every group and record."""
    from mofit.diagnosis.shrinkage import in_percent, labelled_shares

    table = table_of("left out of the fit", "removed %", "5 %", "95 %")
    for name, one in labelled_shares(kinds):
        away = one.get("ran_away", False)
        table.add_row(name, *("–" if away else in_percent(one[key]) for key in ("share", "low", "high")))
    return table
