"""Whether single tests agree on the model's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit.report.display import badge, math_symbol, number, percent, symbol
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.style import MEASURED, image_of, panels

_CHANCE = 0.01


def agreement_section(data: Mapping[str, Any]) -> Section | None:
    """Figure and table; None where too few tests tell."""
    found = [one for one in data["agreements"] if len(one["tests"]) > 1]
    if not found:
        return None
    rows = [
        [
            symbol(one["parameter"]),
            str(len(one["tests"])),
            "< 0.0001" if one["p"] < 1e-4 else number(one["p"], 2),
            percent(one["i_squared"]),
            badge("agree", "good") if one["p"] >= _CHANCE else badge("disagree", "bad"),
        ]
        for one in found
    ]
    blocks: list[Block] = [
        Text(
            "Each test alone, near the joint minimum of the model without effects. If the model were right, the "
            "estimates would scatter as their bars say (Cochran's test)."
        ),
        _figure(found),
        Table(["Parameter", "Tests", "p", "I²", "Verdict"], rows, left=[4]),
    ]
    return Section("agreement", "Do single tests agree?", blocks, {"agreements": data["agreements"]})


def _figure(found: list[Mapping[str, Any]]) -> Figure:
    canvas, axes, _ = panels(len(found), 3, 1.8, margin=(0.8, 0.85, 0.15, 0.4), gap=(0.8, 1.1))
    for panel, one in zip(axes, found, strict=True):
        place = np.arange(len(one["tests"]))
        panel.errorbar(place, one["values"], np.asarray(one["sds"]), color=MEASURED, ls="none", marker="o", ms=4)
        panel.set_xticks(place, one["tests"], rotation=40, ha="right", fontsize=7)
        panel.set_title(f"{math_symbol(one['parameter'])}" + ("" if one["unit"] == "1" else f"  ({one['unit']})"))
    return Figure(
        image_of(canvas),
        "Estimates from each test alone",
        "A parameter per panel: its estimate from each test alone, with standard deviation.",
        good="the bars overlap.",
        bad="the estimates drift from test to test: the parameter takes up something that the model lacks.",
    )
