"""What was ruled out, and why; what could not be looked at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mofit.report.display import compact, number, percent
from mofit.report.page import Block, Details, Section, Table, Text

#: Difference of the criterion, chance and absorbed share that the reasons speak of.
_ALIKE, _CHANCE, _HIDDEN = 6.0, 0.01, 0.99


def ruled_out_section(data: Mapping[str, Any]) -> Section:
    """A table of the candidates that are not named."""
    named = {effect["name"] for effect in data["effects"]}
    rows = [
        [
            data["titles"].get(one["name"], one["name"]),
            number(one["statistic"], 3),
            "< 0.0001" if one["p"] < 1e-4 else number(one["p"], 2),
            percent(one["absorbed"]),
            _reason(one, data),
        ]
        for one in data["candidates"]
        if one["name"] not in named
    ]
    blocks: list[Block] = [
        Table(
            ["Effect", "T", "p", "Absorbed", "Why not"],
            rows,
            "p: chance of such a score without the effect, corrected for the number of candidates. Absorbed: share of "
            "the effect that the model's own parameters would take up, so that it hides.",
            left=[4],
        )
    ]
    if data["left_out"]:
        left = [[name, reason] for name, reason in data["left_out"].items()]
        blocks.append(Details("Effects that could not be candidates", [Table(["Effect", "Why"], left, left=[1])]))
    if not rows:
        blocks = [Text("Every candidate is named.")]
    return Section(
        "ruled_out", "What was ruled out", blocks, {"candidates": data["candidates"], "left_out": data["left_out"]}
    )


def _reason(one: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    alone = next((tried for tried in data["tried"] if tried["effects"] == [one["name"]]), None)
    if one["p"] > _CHANCE:
        hidden = ", but the tests would hardly show it" if one["absorbed"] > _HIDDEN else ""
        return f"no sign of it{hidden}"
    if alone is not None and alone["criterion"] > _ALIKE:
        return f"fits worse: criterion {compact(alone['criterion'], 3)} above the best"
    return "scores less than a quarter of the best"
