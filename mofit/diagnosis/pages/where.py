"""Where the gap lies: tests and spectral classes, input and rate, time, and whether single tests agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from mofit.diagnosis.pages.residuals import AFTER, BEFORE
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES
from mofit.quantities import title_of
from mofit.report.toolkit.axes import heat_map
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, Text, badge, words
from mofit.report.toolkit.description import keyed, test_of
from mofit.report.toolkit.figures import BASELINE, MEASURED, Panels, line_key, mode_colour
from mofit.report.toolkit.formatting import (
    Unit,
    display_unit,
    listed,
    number,
    p_value,
    parameter_label,
    percent,
    symbol,
)

#: p-value, corrected for the number of entries, below which one is set in bold.
_SIGNIFICANT = 0.01
#: Most residual tests that are listed.
_MOST_TESTS = 6
#: Width of a letter of a test's name, inches; letters for which there is room beside the maps.
_LETTER, _LONGEST = 0.07, 40


def where_section(data: Mapping[str, Any]) -> Section:
    """Residual tests, and three maps of what the model without effects leaves."""
    before, after = data["residual_maps"]["before"], data["residual_maps"]["after"]
    unit = data["where"]["unit"]
    blocks: list[Block] = [
        Text(
            "The gap is what measured minus simulated holds beyond the noise. Noise is what differs between periods "
            "or, without a period, what past inputs do not predict."
        ),
        _tests_table(data["where"], data["residual"]),
        *_conditions_table(data["where"]),
        _classes_figure(before, after, unit),
        _input_figure(before["input"], data["records"][0], unit),
        _time_figure(before["time"], after["time"], unit),
    ]
    return Section("where", "Where the gap lies", blocks, {"residual_maps": data["residual_maps"]})


def _conditions_table(where: Mapping[str, Any]) -> list[Block]:
    """The gap under every value of the conditions."""
    entries = where["conditions"]
    if not entries:
        return []
    shown, most = display_unit(where["unit"], [one["gap"] for one in entries]), max(entries, key=lambda one: one["gap"])
    units = [display_unit(one["unit"], [one["value"]]) for one in entries]
    values = [f"{number(one['value'] * unit.factor)} {unit.name}" for one, unit in zip(entries, units, strict=True)]
    return [
        Text(f"The gap is largest under a {title_of(most['condition'])} of {values[entries.index(most)]}."),
        Table(
            [
                words("Condition", [title_of(one["condition"]) for one in entries]),
                words("Value", values),
                Column("Tests", [str(one["tests"]) for one in entries]),
                Column(shown.label("Gap"), [number(one["gap"] * shown.factor, 3) for one in entries]),
            ],
            "Root mean square beyond the noise, without effects.",
        ),
    ]


def _tests_table(before: Mapping[str, Any], after: Mapping[str, Any]) -> Block:
    """The most significant residual tests: those of the best model first, then those of the baseline."""
    sources = [{test["name"]: test for test in one["residual_tests"]} for one in (before, after)]
    described = {name: test["description"] for one in reversed(sources) for name, test in one.items()}
    names = list(described)[:_MOST_TESTS]
    if not names:
        return Text("No residual test is significant.")
    shown = display_unit(before["unit"], max(test["rms"] for one in sources for test in one.values()))
    columns = [words("Residual test", [described[name] for name in names])]
    for title, tests in zip((BEFORE, AFTER), sources, strict=True):
        found = [tests.get(name) for name in names]
        sizes = ["–" if test is None else number(shown.factor * test["rms"], 2) for test in found]
        columns.append(Column(f"{title} ({shown.name})", sizes))
        columns.append(Column("p", ["–" if test is None else p_value(test["p_value"]) for test in found]))
    return Table(
        columns,
        "Residual tests need no candidate effect. Root mean square over all tests beyond the noise; p-value corrected "
        "for the number of residual tests. A dash: not significant.",
    )


def _classes_figure(before: Mapping[str, Any], after: Mapping[str, Any], unit: str) -> Figure:
    maps = _rows(before["residuals"], after["residuals"])
    tests = list(dict.fromkeys(entry["test"] for entry in maps[0]))
    present = {entry["lines"] for entry in maps[0]}
    classes = {one.name: one.label for one in SPECTRAL_CLASSES if one.name in present}
    largest = max((entry["gap"] for entry in maps[0]), default=1.0) or 1.0
    shown = display_unit(unit, largest)
    left = 0.25 + _LETTER * min(max(map(len, tests), default=0), _LONGEST)
    panels = Panels(2, 2, 0.27 * len(tests) + 0.2, margin=(left, 0.65, 0.1), top=0.5, gap=(0.25, 0.5))
    for axes, source, title in zip(panels.axes, maps, (BEFORE, AFTER), strict=True):
        _class_map(axes, source, tests, classes, largest, shown.factor)
        axes.set_title(f"{title}: gap ({shown.name})")
        keyed(axes, model=title)
        keyed(axes.xaxis, lines=list(classes))
        keyed(axes.yaxis, test=[test_of(test) for test in tests])
    panels.axes[1].set_yticklabels([])
    return panels.figure(
        "Gap per test and spectral class, before and after",
        "Root mean square of the gap per test and class of spectral lines: constant; odd, even and half multiples of "
        "the excitation frequency; rotational orders; the rest. Bold: significant at 1 % over the whole map. A "
        "click on a cell opens the spectrum and the time trace of its test.",
        good="no cell on the right is bold.",
        bad="cells on the right are bold as well: no named effect explains what is left there.",
        finding=_largest_entry(maps, classes, shown),
        opens="residuals",
    )


def _largest_entry(maps: Sequence[Sequence[Mapping[str, Any]]], classes: Mapping[str, str], shown: Unit) -> str:
    """Where the gap of the model without effects is largest, and what is left there with the best one."""
    before = max(maps[0], key=lambda entry: entry["gap"], default=None)
    if before is None or not before["gap"]:
        return "No class of lines holds a gap."
    place = before["test"], before["lines"]
    left = sum(entry["gap"] for entry in maps[1] if (entry["test"], entry["lines"]) == place)
    label = classes[before["lines"]].replace("-\n", "").replace("\n", " ")
    return (
        f"The gap is largest in {before['test']}, lines '{label}': {number(shown.factor * before['gap'], 2)} "
        f"{shown.name}; with the best model {number(shown.factor * left, 2)} {shown.name} are left there."
    )


def _rows(*maps: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """The entries of maps, of several outputs each with a row per test and output."""
    if len({entry["output"] for entries in maps for entry in entries}) < 2:
        return [list(entries) for entries in maps]
    return [[{**entry, "test": f"{entry['test']} / {entry['output']}"} for entry in entries] for entries in maps]


def _class_map(
    axes: Axes,
    entries: Sequence[Mapping[str, Any]],
    tests: Sequence[str],
    classes: Mapping[str, str],
    largest: float,
    factor: float,
) -> None:
    values = np.zeros((len(tests), len(classes)))
    for entry in entries:
        i, k = tests.index(entry["test"]), list(classes).index(entry["lines"])
        significant = entry["p_value"] * len(entries) < _SIGNIFICANT
        values[i, k] = entry["gap"]
        grey = "black" if significant else BASELINE
        axes.text(
            k,
            i,
            number(factor * entry["gap"], 2),
            ha="center",
            va="center",
            fontsize=7.5,
            weight="bold" if significant else "normal",
            color="white" if entry["gap"] > 0.45 * largest else grey,
        )
    heat_map(axes, values, tests, list(classes.values()), cmap="Blues", vmin=0, vmax=largest)


def _agreement(found: Sequence[Mapping[str, Any]]) -> Markup:
    apart = [symbol(one["parameter"]) for one in found if one["p_value"] < _SIGNIFICANT]
    if not apart:
        return Markup("All tests agree on every parameter.")
    return Markup("The tests disagree on {}.").format(listed(apart))


def _input_figure(found: Mapping[str, Any], record: Mapping[str, Any], unit: str) -> Figure:
    gap = np.asarray(found["gap"], dtype=float)
    clear = np.where(np.abs(gap) > 2 * np.asarray(found["error"], dtype=float), gap, np.nan)
    edges = [np.asarray(found[key]) for key in ("input_edges", "rate_edges")]
    x, y = (display_unit(record["input_unit"], edge) for edge in edges)
    shown = display_unit(unit, np.nan_to_num(gap))
    largest = shown.factor * (float(np.nanmax(np.abs(gap))) or 1.0 if np.isfinite(gap).any() else 1.0)
    panels = Panels(2, 2, 2.6, margin=(0.8, 0.55, 0.1), top=0.4, gap=(1.0, 0.5))
    for axes, values, title in zip(panels.axes, (gap, clear), ("mean gap", "beyond two standard errors"), strict=True):
        mesh = (x.factor * edges[0], y.factor * edges[1], shown.factor * values.T)
        axes.pcolormesh(*mesh, cmap="RdBu_r", vmin=-largest, vmax=largest)
        axes.set_title(f"{title} (±{number(largest, 2)} {shown.name})")
        axes.set_xlabel(x.label(record["input_name"]))
        axes.set_ylabel(f"its rate ({y.name}/s)")
        axes.grid(visible=False)
    return panels.figure(
        "Mean gap over the input and its rate",
        "Mean of measured minus simulated over the input and its rate, on lines that a model can explain. Red: the "
        "measured output is larger.",
        good="no pattern, and hardly a cell on the right.",
        bad="bands along the input (a static curve is wrong) or along its rate (a dynamic part is).",
        finding=f"{int(np.isfinite(clear).sum())} of {int(np.isfinite(gap).sum())} cells lie beyond two standard "
        "errors (chance: one in twenty).",
    )


def _time_figure(before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]], unit: str) -> Figure:
    shown = display_unit(unit, np.concatenate([part["gap"] for part in before]))
    legend = [line_key(BASELINE, BEFORE), line_key(mode_colour(0), AFTER)]
    panels = Panels(1, 1, 1.7, legend=legend, margin=(0.8, 0.55, 0.15), top=0.45)
    axes, offset, timed = panels.axes[0], 0.0, all(part["start_time"] is not None for part in before)
    for part, later in zip(before, after, strict=True):
        test = test_of(part["test"])
        time = np.asarray(part["time"]) + (part["start_time"] if timed else offset)
        for one, model, colour in ((part, BEFORE, BASELINE), (later, AFTER, mode_colour(0))):
            (line,) = axes.plot(time, shown.factor * np.asarray(one["gap"]), color=colour, marker=".")
            keyed(line, test=test, model=model)
        offset = float(time[-1]) * 1.02
    axes.set_ylim(bottom=0)
    x = "time since the campaign began (s)" if timed else "tests one after another (s)"
    panels.label(x, shown.label("residual"))
    return panels.figure(
        "Residual over time",
        "Root mean square of the residual within each test, on lines that a model can explain, noise included.",
        good="the lines are level.",
        bad="they rise or fall within the tests, or from test to test in the order of the runs.",
        finding=_drift(before, shown),
    )


def _drift(before: Sequence[Mapping[str, Any]], shown: Unit) -> str:
    means = [float(np.nanmean(part["gap"])) for part in before]
    low, high = int(np.argmin(means)), int(np.argmax(means))
    least, most = (f"{number(shown.factor * means[k], 2)} {shown.name} in {before[k]['test']}" for k in (low, high))
    return f"The residual of the model without effects lies between {least} and {most}."


def homogeneity_section(data: Mapping[str, Any]) -> Section | None:
    """Estimates from each test alone; None where fewer than two tests inform any parameter."""
    found = [one for one in data["test_estimates"] if len(one["tests"]) > 1]
    if not found:
        return None
    panels = Panels(len(found), 3, 1.8, margin=(0.8, 0.85, 0.15), top=0.4, gap=(0.8, 1.1))
    for axes, one in zip(panels.axes, found, strict=True):
        place = np.arange(len(one["tests"]))
        axes.errorbar(place, one["values"], np.asarray(one["sds"]), color=MEASURED, ls="none", marker="o", ms=4)
        axes.set_xticks(place, one["tests"], rotation=40, ha="right", fontsize=7)
        keyed(axes.xaxis, test=[test_of(test) for test in one["tests"]])
        axes.set_title(parameter_label(one["parameter"], one["unit"]))
    figure = panels.figure(
        "Estimates from each test alone",
        "Estimate of each parameter from each test alone, with standard deviation.",
        good="the bars overlap.",
        bad="the estimates drift from test to test: the parameter compensates for something that the model lacks.",
        finding=_agreement(found),
    )
    verdicts = [badge("agree", "good") if one["p_value"] >= _SIGNIFICANT else badge("disagree", "bad") for one in found]
    table = Table(
        [
            Column("Parameter", [symbol(one["parameter"]) for one in found]),
            Column("Tests", [str(len(one["tests"])) for one in found]),
            Column("p", [p_value(one["p_value"]) for one in found]),
            Column("I²", [percent(one["i_squared"]) for one in found]),
            words("Verdict", verdicts),
        ],
        "Cochran's test of homogeneity. I²: share of the scatter beyond the estimates' own uncertainty.",
    )
    text = Text(
        "The model without effects is fitted to each test alone, near the joint minimum. If the model is right, the "
        "estimates agree within their standard deviations."
    )
    data = {"test_estimates": data["test_estimates"]}
    return Section("homogeneity", "Do single tests agree?", [text, figure, table], data)
