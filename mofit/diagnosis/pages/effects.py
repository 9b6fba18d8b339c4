"""Which effects: those named with their sizes, the models that were fitted, and what is ruled out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit.report.toolkit.blocks import Block, Column, Details, Figure, Section, Table, Text, badge, words
from mofit.report.toolkit.figures import BASELINE, Panels, mode_colour
from mofit.report.toolkit.formatting import compact, interval, number, p_value, percent, symbol, unit_text, with_sd

#: Most models and candidates that are shown.
_SHOWN = 12
#: Width of a 90 % interval in standard deviations.
_INTERVAL = 3.29


def effects_section(data: Mapping[str, Any]) -> Section:
    """Named effects, fitted models, score statistics, and the bias of the model's own parameters."""
    named = bool(data["effects"])
    blocks: list[Block] = [_named_table(data) if named else Text("No effect is named.")]
    if len(data["fitted_models"]) > 1:
        blocks.append(_models_table(data))
    blocks.append(_scores_figure(data))
    if named:
        blocks.append(_bias_table(data))
    keys = ("effects", "fitted_models", "candidates", "model_parameters")
    return Section("which", "Which effect causes it", blocks, {key: data[key] for key in keys})


def _title(data: Mapping[str, Any], name: str) -> str:
    return str(data["titles"].get(name, name))


def _named_table(data: Mapping[str, Any]) -> Table:
    effects = data["effects"]
    lows, highs = ([one[key] for one in effects] for key in ("size_low", "size_high"))
    sds = [(high - low) / _INTERVAL for low, high in zip(lows, highs, strict=True)]
    expected = {one["name"]: compact(float(np.linalg.norm(one["expected_size"])), 3) for one in data["candidates"]}
    parameters = [
        [Markup("{} = {}").format(symbol(k), compact(v, 4)) for k, v in one["parameters"].items()] for one in effects
    ]
    return Table(
        [
            Column("Effect", [_title(data, one["name"]) for one in effects]),
            words("Family", [one["family"] for one in effects]),
            Column("Probability", [percent(one["probability"]) for one in effects]),
            Column("Size", [with_sd(one["size"], sd) for one, sd in zip(effects, sds, strict=True)]),
            Column("90 % interval", list(map(interval, lows, highs, sds))),
            Column("Expected", [expected.get(one["name"], "–") for one in effects]),
            words("Unit", [unit_text(one["unit"]) for one in effects]),
            words("Parameters", [Markup(", ").join(pairs) for pairs in parameters]),
            words("Present in", ["all tests" if one["present_in_calibration"] else "dynamic tests" for one in effects]),
        ],
        "Named effects with their fitted size. Expected: the score test's estimate, before any refit. Present in all "
        "tests: the effect seems to be present in the calibration tests too.",
    )


def _models_table(data: Mapping[str, Any]) -> Table:
    models, equal = data["fitted_models"][:_SHOWN], len(data["candidate_models"])
    caption = "Refitted models, by information criterion."
    return Table(
        [
            Column("Effects", [" + ".join(_title(data, name) for name in one["effects"]) or "none" for one in models]),
            Column("Criterion above the best", [number(one["criterion"], 3) for one in models]),
            Column("Probability", [percent(one["probability"]) for one in models]),
        ],
        caption + (f" These data cannot distinguish the first {equal}." if equal > 1 else ""),
    )


def _scores_figure(data: Mapping[str, Any]) -> Figure:
    candidates = [one for one in data["candidates"] if one["statistic"] > 0][:_SHOWN]
    candidates.sort(key=lambda one: one["statistic"])
    named = {effect["name"] for effect in data["effects"]}
    panels = Panels(1, 1, 0.2 * max(len(candidates), 3) + 0.1, margin=(2.6, 0.5, 0.2), top=0.3)
    axes = panels.axes[0]
    axes.barh(
        [_title(data, one["name"]) for one in candidates],
        [one["statistic"] for one in candidates],
        color=[mode_colour(0) if one["name"] in named else BASELINE for one in candidates],
    )
    axes.set_xscale("log")
    axes.set_xlim(left=1)
    axes.set_xlabel("score statistic T  (–)")
    axes.grid(axis="y", visible=False)
    return panels.figure(
        "Score statistic of the candidates",
        "How much each effect would explain of the residual of the model without effects. Blue: named. Effects that "
        "resemble the right one score as well: the refits decide. Without the effect, T is chi-square distributed with "
        "one degree of freedom per component of its size.",
        good="one bar is much longer than the others, and it is blue.",
        bad="several bars are equally long: see what to test next.",
        finding=_first_and_second(data, candidates),
    )


def _first_and_second(data: Mapping[str, Any], candidates: Sequence[Mapping[str, Any]]) -> str:
    """The largest scores; `candidates` are in ascending order."""
    if not candidates:
        return "No effect would explain anything of the residual."
    shown = [f"{_title(data, one['name'])} (T = {number(one['statistic'], 3)})" for one in candidates[:-3:-1]]
    return f"The largest score has {shown[0]}" + (f", the next {shown[1]}." if len(shown) > 1 else ".")


def _bias_table(data: Mapping[str, Any]) -> Table:
    own = data["model_parameters"]
    biases = [one["before"] - one["after"] for one in own.values()]
    in_sd = [bias / one["sd"] if one["sd"] else np.nan for bias, one in zip(biases, own.values(), strict=True)]
    return Table(
        [
            Column("Parameter", [symbol(name) for name in own]),
            Column("Without the effect", [compact(one["before"], 4) for one in own.values()]),
            Column("With", [compact(one["after"], 4) for one in own.values()]),
            Column("Bias", [compact(bias, 3) for bias in biases]),
            words("Unit", [unit_text(one["unit"]) for one in own.values()]),
            Column("Bias / sd", [number(ratio, 2) for ratio in in_sd]),
            words("", [_bias_badge(one) for one in own.values()]),
        ],
        "A small residual is not a small effect: the model's own parameters absorb it where they can. Biased: the "
        "effect moves the estimate by more than three standard deviations (sd).",
    )


def _bias_badge(one: Mapping[str, Any]) -> Markup:
    if one["at_bound"]:
        return badge("at a bound", "bad")
    biased = one["sd"] > 0 and abs(one["before"] - one["after"]) > 3 * one["sd"]
    return badge("biased", "bad") if biased else badge("fine", "good")


def ruled_out_section(data: Mapping[str, Any]) -> Section:
    """The candidates that are not named, what became of each and why; effects that could not be candidates."""
    named = {effect["name"] for effect in data["effects"]}
    others = [one for one in data["accounts"] if one["name"] not in named]
    scores = {one["name"]: one for one in data["candidates"]}
    blocks: list[Block] = [_accounts_table(data, others, scores) if others else Text("Every candidate is named.")]
    if left_out := data["left_out"]:
        table = Table([words("Effect", list(left_out)), words("Why", list(left_out.values()))])
        blocks.append(Details("Effects that could not be candidates", [table]))
    numbers = {"accounts": data["accounts"], "candidates": data["candidates"], "left_out": left_out}
    return Section("ruled_out", "What is ruled out", blocks, numbers)


def _accounts_table(
    data: Mapping[str, Any], accounts: Sequence[Mapping[str, Any]], scores: Mapping[str, Mapping[str, Any]]
) -> Table:
    def cells(key: str, form: Callable[[float], str]) -> list[str]:
        return [form(scores[one["name"]][key]) if one["name"] in scores else "–" for one in accounts]

    return Table(
        [
            Column("Effect", [_title(data, one["name"]) for one in accounts]),
            Column("T", cells("statistic", lambda value: number(value, 3))),
            Column("p", cells("p_value", p_value)),
            Column("Confounding", cells("confounding", percent)),
            words("Outcome", [one["outcome"] for one in accounts]),
            words("Why", [one["reason"] for one in accounts]),
        ],
        "T: score statistic. p: corrected for the number of candidates. Confounding: share of the effect that the "
        "model's own parameters absorb and hide. Criterion: below 6 above the best, a model is hardly ruled out.",
    )
