"""Which effects: those named with their sizes, and every explanation that was tried."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit.report.display import badge, compact, number, percent, symbol, with_sd
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.style import BASELINE, cluster_colour, image_of, panels

_SHOWN = 12


def ranking_section(data: Mapping[str, Any]) -> Section:
    """Named effects, explanations, and what leaving them out does to the model's own parameters."""
    blocks: list[Block] = []
    if data["effects"]:
        blocks.append(_named(data))
    if len(data["tried"]) > 1:
        blocks.append(_tried(data))
    blocks.append(_screen_figure(data))
    if data["effects"]:
        blocks.append(_bias(data))
    else:
        blocks.insert(0, Text("No effect is named."))
    keys = ("effects", "tried", "candidates", "own_parameters")
    return Section("which", "Which effect causes it", blocks, {key: data[key] for key in keys})


def _named(data: Mapping[str, Any]) -> Table:
    rows = []
    for effect in data["effects"]:
        sd = (effect["size_high"] - effect["size_low"]) / 3.29
        interval = f"{with_sd(effect['size_low'], sd)} to {with_sd(effect['size_high'], sd)}"
        scored = {one["name"]: one["expected_size"] for one in data["candidates"]}
        expected: list[float] = scored.get(effect["name"], [])
        rows.append(
            [
                data["titles"].get(effect["name"], effect["name"]),
                percent(effect["probability"]),
                with_sd(effect["size"], sd),
                interval,
                compact(float(np.linalg.norm(expected)), 3) if expected else "–",
                effect["unit"],
                Markup(", ").join(
                    Markup("{} = {}").format(symbol(k), compact(v, 4)) for k, v in effect["parameters"].items()
                ),
                "all" if effect["calibration_tests_too"] else "dynamic",
            ]
        )
    return Table(
        ["Effect", "Probability", "Size", "90 % interval", "Expected", "Unit", "Parameters", "Tests"],
        rows,
        "Effects named, with fitted size; expected: from the score test, before any refit. Tests: whether the "
        "calibration tests seem to have had the effect too.",
        left=[5, 6, 7],
    )


def _tried(data: Mapping[str, Any]) -> Table:
    rows = [
        [
            " + ".join(data["titles"].get(name, name) for name in one["effects"]) or "none",
            number(one["criterion"], 3),
            percent(one["probability"]),
        ]
        for one in data["tried"][:_SHOWN]
    ]
    alike = len(data["explanations"])
    return Table(
        ["Explanation", "Criterion above the best", "Probability"],
        rows,
        "Explanations that were fitted in full, by information criterion."
        + (f" The first {alike} count as alike." if alike > 1 else ""),
    )


def _screen_figure(data: Mapping[str, Any]) -> Figure:
    candidates = [one for one in data["candidates"] if one["statistic"] > 0][:_SHOWN]
    candidates.sort(key=lambda one: one["statistic"])
    canvas, (axes,), _ = panels(1, 1, 0.2 * max(len(candidates), 3) + 0.1, margin=(2.6, 0.5, 0.2, 0.3))
    named = {effect["name"] for effect in data["effects"]}
    colours = [cluster_colour(0) if one["name"] in named else BASELINE for one in candidates]
    titles = [data["titles"].get(one["name"], one["name"]) for one in candidates]
    axes.barh(titles, [one["statistic"] for one in candidates], color=colours)
    axes.set_xscale("symlog", linthresh=10)
    axes.set_xlabel("score statistic T (chi-square with one degree of freedom where there is no such effect)")
    axes.grid(axis="y", visible=False)
    return Figure(
        image_of(canvas),
        "Score statistic of the candidates",
        "How clearly each effect would explain what the model without effects leaves; blue: named. Effects that "
        "resemble the right one score as well: the fits in full decide.",
        good="one bar stands out, and it is blue.",
        bad="several bars are alike: see what to test next.",
    )


def _bias(data: Mapping[str, Any]) -> Table:
    rows = []
    for name, own in data["own_parameters"].items():
        change = own["before"] - own["after"]
        strange = own["at_bound"] or (own["sd"] > 0 and abs(change) > 3 * own["sd"])
        rows.append(
            [
                symbol(name),
                compact(own["before"], 4),
                compact(own["after"], 4),
                "" if own["unit"] == "1" else own["unit"],
                percent(change / own["after"]) if own["after"] else "–",
                badge("at a bound", "bad")
                if own["at_bound"]
                else badge("biased" if strange else "fine", "bad" if strange else "good"),
            ]
        )
    return Table(
        ["Parameter", "Without the effect", "With", "Unit", "Bias", ""],
        rows,
        "A small residual is no small effect: the model's own parameters take it up where they can. Biased: moved by "
        "more than three of its standard deviations.",
        left=[3, 5],
    )
