"""Where the gap lies: tests and line classes, input and rate, time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import display_unit, number
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.style import BASELINE, cluster_colour, image_of, legend_above, line_key, panels

_CHANCE = 0.01
#: most clues that are listed
_CLUES = 6
#: width of a letter of a test's name, inches; letters for which there is room beside the maps
_LETTER, _LONGEST = 0.07, 40
_NAMES = {
    "dc": "constant",
    "odd": "odd",
    "even": "even",
    "subharmonic": "half",
    "rotating": "wheel,\ndrum",
    "slow": "slow",
    "steady": "steady\nlines",
    "excited": "excited",
    "other": "other",
}


def gap_section(data: Mapping[str, Any]) -> Section:
    """Three maps of what the model without effects leaves, and the first again with the best explanation."""
    before, after = data["maps"]["before"], data["maps"]["after"]
    blocks: list[Block] = [
        Text(
            "What is left of measured minus simulated beyond the noise, split by spectral lines. The noise is what "
            "differs from period to period; a cell is marked where chance would fill it so less than once in a hundred "
            "maps."
        ),
        _clues_table(data["where"], data["left"]),
        _classes_figure(before, after, data["where"]["unit"]),
        _input_figure(before, data),
        _time_figure(before, after, data["where"]["unit"]),
    ]
    return Section("where", "Where the gap lies", blocks, {"maps": data["maps"]})


def _clues_table(before: Mapping[str, Any], after: Mapping[str, Any]) -> Block:
    """What tells the gap: the surest clues that are left, then those that the model without effects had."""
    told = {clue["name"]: clue["told"] for clue in (*after["clues"], *before["clues"])}
    if not told:
        return Text("No test of what is left sees more than chance.")
    shown = display_unit(before["unit"], max(clue["rms"] for clue in (*before["clues"], *after["clues"])))
    rows = [
        [words, *(cell for source in (before, after) for cell in _clue(name, source["clues"], shown.factor))]
        for name, words in list(told.items())[:_CLUES]
    ]
    return Table(
        ["What tells it", f"without effects ({shown.name})", "p", f"with the best explanation ({shown.name})", "p"],
        rows,
        "Tests of what is left that need no candidate. Root mean square over all tests beyond the noise, and the "
        "chance of so much without a gap, corrected for the number of such tests; a dash: not beyond chance.",
    )


def _clue(name: str, clues: list[Mapping[str, Any]], factor: float) -> tuple[str, str]:
    """Size and chance of one clue; a dash where it is not among those beyond chance."""
    found = next((clue for clue in clues if clue["name"] == name), None)
    return ("–", "–") if found is None else (number(factor * found["rms"], 2), _chance(found["p"]))


def _chance(p: float) -> str:
    return "< 1e-16" if p < 1e-16 else f"{p:.1g}"


def _classes_figure(before: Mapping[str, Any], after: Mapping[str, Any], unit: str) -> Figure:
    tests = list(dict.fromkeys(spot["test"] for spot in before["spots"]))
    classes = [name for name in _NAMES if any(spot["lines"] == name for spot in before["spots"])]
    largest = max((spot["gap"] for spot in before["spots"]), default=1.0) or 1.0
    shown = display_unit(unit, largest)
    names = 0.25 + _LETTER * min(max(map(len, tests), default=0), _LONGEST)
    canvas, axes, _ = panels(2, 2, 0.27 * len(tests) + 0.2, margin=(names, 0.65, 0.1, 0.5), gap=(0.25, 0.5))
    for panel, source, title in zip(
        axes, (before, after), ("without effects", "with the best explanation"), strict=True
    ):
        _grid(panel, source["spots"], tests, classes, largest, shown.factor)
        panel.set_title(f"{title}: gap ({shown.name})")
    axes[1].set_yticklabels([])
    return Figure(
        image_of(canvas),
        "Gap per test and class of lines, before and after",
        "Root mean square of the gap per test and class of spectral lines: constant; odd, even and half multiples of "
        "the frequency of excitation; of wheel and drum; the rest. Bold: beyond chance.",
        good="no cell on the right is bold.",
        bad="a column or a run of cells is bold on the right as well: something is left that no named effect explains.",
    )


def _grid(
    axes: Axes, spots: list[Mapping[str, Any]], tests: list[str], classes: list[str], largest: float, factor: float
) -> None:
    values = np.zeros((len(tests), len(classes)))
    for spot in spots:
        i, k = tests.index(spot["test"]), classes.index(spot["lines"])
        loud = (spot["p"] is not None) and spot["p"] * len(spots) < _CHANCE
        values[i, k] = spot["gap"]
        dark = spot["gap"] > 0.45 * largest
        axes.text(
            k, i, number(factor * spot["gap"], 2), ha="center", va="center", fontsize=7.5,
            weight="bold" if loud else "normal", color="white" if dark else ("black" if loud else "#8c959f"),
        )  # fmt: skip
    axes.imshow(values, cmap="Blues", vmin=0, vmax=largest, aspect="auto")
    axes.grid(False)
    axes.set_xticks(range(len(classes)), [_NAMES[name] for name in classes])
    axes.set_yticks(range(len(tests)), tests)
    axes.tick_params(length=0)


def _input_figure(before: Mapping[str, Any], data: Mapping[str, Any]) -> Figure:
    found, series = before["input"], data["series"][0]
    gap = np.asarray(found["gap"], dtype=float)
    clear = np.where(np.abs(gap) > 2 * np.asarray(found["error"], dtype=float), gap, np.nan)
    x, y = (
        display_unit(series["input_unit"], found["input_edges"]),
        display_unit(series["input_unit"], found["rate_edges"]),
    )
    shown = display_unit(data["where"]["unit"], np.nan_to_num(gap))
    largest = float(np.nanmax(np.abs(gap))) or 1.0 if np.isfinite(gap).any() else 1.0
    canvas, (axes, beside), _ = panels(2, 2, 2.6, margin=(0.8, 0.55, 0.1, 0.4), gap=(1.0, 0.5))
    for panel, values, title in ((axes, gap, "mean gap"), (beside, clear, "where it exceeds two standard errors")):
        panel.pcolormesh(
            x.factor * np.asarray(found["input_edges"]), y.factor * np.asarray(found["rate_edges"]),
            shown.factor * values.T,
            cmap="RdBu_r", vmin=-shown.factor * largest, vmax=shown.factor * largest,
        )  # fmt: skip
        panel.set_title(f"{title} (±{number(shown.factor * largest, 2)} {shown.name})")
        panel.set_xlabel(x.label(series["input_name"]))
        panel.set_ylabel(f"its rate ({y.name}/s)")
        panel.grid(False)
    return Figure(
        image_of(canvas),
        "Mean gap over the input and its rate",
        "Mean of measured minus simulated, on lines that can be explained, over the input and its rate; red: the "
        "measured output is larger.",
        good="no pattern, and hardly a cell on the right.",
        bad="bands along the input (a static curve is wrong), or along the rate (a dynamic part is).",
    )


def _time_figure(before: Mapping[str, Any], after: Mapping[str, Any], unit: str) -> Figure:
    parts = before["time"]
    shown = display_unit(unit, np.concatenate([part["gap"] for part in parts]))
    canvas, (axes,), _ = panels(1, 1, 1.7, margin=(0.8, 0.55, 0.15, 0.45))
    offset, timed = 0.0, all(part["start_time"] is not None for part in parts)
    for part, later in zip(parts, after["time"], strict=True):
        start = part["start_time"] if timed else offset
        time = np.asarray(part["time"]) + start
        axes.plot(time, shown.factor * np.asarray(part["gap"]), color=BASELINE, marker=".")
        axes.plot(time, shown.factor * np.asarray(later["gap"]), color=cluster_colour(0), marker=".")
        offset = float(time[-1]) * 1.02
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time since the campaign began (s)" if timed else "tests one after another (s)")
    axes.set_ylabel(shown.label("structured residual"))
    legend_above(
        canvas, [line_key(BASELINE, "without effects"), line_key(cluster_colour(0), "with the best explanation")]
    )
    return Figure(
        image_of(canvas),
        "Structured residual over time",
        "Root mean square of the residual on lines that can be explained, noise on them included, over each test.",
        good="level.",
        bad="rising or falling within the tests, or from test to test in the order in which they were run.",
    )
