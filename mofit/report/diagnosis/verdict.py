"""The verdict in a sentence, and the few numbers that matter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from mofit.report.display import THIN, display_unit, number, percent
from mofit.report.page import Block, Raw, Section, Text

_GRADES = {"none": "good", "effect": "good", "group": "bad", "several": "good", "unknown": "bad"}


def verdict_section(data: Mapping[str, Any]) -> Section:
    """Banner, cards and what follows from them."""
    where, shrinkage = data["where"], data["shrinkage"]
    unit = display_unit(where["unit"], where["gap"])
    cards = [_card(f"{number(unit.factor * where['gap'])}{THIN}{unit.name}", "gap, root mean square over all tests")]
    if where["spots"]:
        cards.append(_card(percent(where["of_peak"]), "of the output's peak, where the gap is largest"))
    if shrinkage:
        share = f"{percent(shrinkage['low'])} to {percent(shrinkage['high'])}"
        cards.append(_card(percent(shrinkage["confirmed"]), f"of the gap removed on held-out tests (90 %: {share})"))
        cards.append(_card(percent(shrinkage["predicted"]), "predicted before any refit"))
    blocks: list[Block] = [
        Raw(Markup('<div class="banner {}">{}</div>').format(_GRADES[data["verdict"]], data["sentence"])),
        Raw(Markup('<div class="cards">{}</div>').format(Markup("").join(cards))),
    ]
    if not shrinkage:
        blocks.append(Text(f"How far the gap would shrink is not said: {data['shrinkage_reason']}."))
    if data["next_test"]:
        blocks.append(Text(Markup("<b>What to test next.</b> {}").format(data["next_test"]["sentence"])))
    keys = ("verdict", "sentence", "effects", "group", "shrinkage", "shrinkage_reason", "next_test")
    return Section("summary", "Verdict", blocks, {key: data[key] for key in keys})


def _card(value: str, text: str) -> Markup:
    return Markup('<div class="card"><b>{}</b><span>{}</span></div>').format(value, text)
