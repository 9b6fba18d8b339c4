"""The diagnosis page: its sections in order, and of those the verdict, how far the gap shrinks, and the method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit.diagnosis.effect_file import EFFECT_FILE, effect_file
from mofit.diagnosis.pages.effects import effects_section, ruled_out_section
from mofit.diagnosis.pages.hold_outs import hold_out_blocks
from mofit.diagnosis.pages.proposed import proposed_section
from mofit.diagnosis.pages.residuals import AFTER, BEFORE, COLUMNS, MODELS, MOST, residuals_section
from mofit.diagnosis.pages.where import homogeneity_section, where_section
from mofit.diagnosis.result import Diagnosis, page_data
from mofit.diagnosis.shrinkage import in_percent
from mofit.report import Page
from mofit.report.toolkit.axes import axis_of_tests
from mofit.report.toolkit.blocks import Block, Figure, Section, Text, banner, cards, method_section
from mofit.report.toolkit.description import keyed, test_of
from mofit.report.toolkit.figures import (
    BASELINE,
    FLOOR,
    MEASURED,
    Panels,
    band_key,
    dot_key,
    line_key,
    mode_colour,
    panel_of,
)
from mofit.report.toolkit.formatting import THIN, Unit, display_unit, number, percent
from mofit.report.toolkit.page import draw_sections, write_json, write_page

_GRADES = {"none": "good", "effect": "good", "group": "bad", "several": "good", "partly": "fair", "unknown": "bad"}
_LAYOUT: Any = {"margin": (0.75, 0.5, 0.1), "gap": (0.5, 0.85)}


def diagnosis_page(diagnosis: Diagnosis) -> Page:
    """The page of a diagnosis, to be seen in a notebook; nothing is kept on disk."""
    with TemporaryDirectory() as folder:
        return Page(write_diagnosis(diagnosis, Path(folder)).read_text(encoding="utf-8"))


def write_diagnosis(diagnosis: Diagnosis, folder: Path) -> Path:
    """Write ``diagnosis.html`` and the numbers behind it, ``diagnosis.json``, into an existing folder.

    Beside them a proposed term as an effect file, ``proposed_effect.py``.

    Returns
    -------
    Path
        The page. Style, script and figures are inside; nothing is fetched.
    """
    data = page_data(diagnosis)
    effect = effect_file(diagnosis.proposed, data["campaign"], data["model_title"]) if diagnosis.proposed else ""
    return write_files(data, effect, folder)


def write_files(data: Mapping[str, Any], effect: str, folder: Path, processes: int = 1) -> Path:
    """Write page, numbers and, where there is one, the text of a proposed ``effect``; so many processes draw."""
    sections = draw_sections(
        [
            verdict_section,
            where_section,
            residuals_section,
            effects_section,
            shrinkage_section,
            *([proposed_section] if effect else []),
            ruled_out_section,
            homogeneity_section,
            closing_section,
        ],
        data,
        processes=processes,
        first=[residuals_section, shrinkage_section, where_section, homogeneity_section],
    )
    write_json(folder / "diagnosis.json", data)
    if effect:
        (folder / EFFECT_FILE).write_text(effect, encoding="utf-8")
    source = f"{data['model_title']} · {data['campaign']} ({data['source']})"
    return write_page(folder / "diagnosis.html", "Diagnosis of the gap", source, sections)


def verdict_section(data: Mapping[str, Any]) -> Section:
    """The verdict in a sentence, the few numbers that matter, and what follows from them."""
    where, shrinkage = data["where"], data["shrinkage"]
    unit = display_unit(where["unit"], where["gap"])
    key_figures = [(f"{number(unit.factor * where['gap'])}{THIN}{unit.name}", "gap, root mean square over all tests")]
    if where["residuals"]:
        key_figures.append((percent(where["of_peak"]), "of the output's peak, where the gap is largest"))
    if shrinkage:
        headline = shrinkage["kinds"][-1]
        share, low, high = (f"{in_percent(headline[key])}{THIN}%" for key in ("share", "low", "high"))
        removed = f"of the gap removed on {headline['place']} (90 % interval: {low} to {high})"
        key_figures.append((share, removed))
    blocks: list[Block] = [banner(data["sentence"], _GRADES[data["verdict"]]), cards(key_figures)]
    if not shrinkage:
        blocks.append(Text(f"The shrinkage is not reported: {data['shrinkage_reason']}."))
    else:
        blocks.append(Text(" ".join(filter(None, (shrinkage["sentence"], shrinkage["caveat"])))))
    if data["verdict"] in ("partly", "unknown") and not data["proposed"]:
        blocks.append(Text(f"No term is proposed: {data['proposed_reason']}."))
    if data["next_experiment"]:
        blocks.append(Text(Markup("<b>What to test next.</b> {}").format(data["next_experiment"]["sentence"])))
    keys = (
        "verdict",
        "sentence",
        "effects",
        "group",
        "shrinkage",
        "shrinkage_reason",
        "proposed_reason",
        "next_experiment",
    )
    return Section("summary", "Verdict", blocks, {key: data[key] for key in keys})


def shrinkage_section(data: Mapping[str, Any]) -> Section:
    """NRMSD per test, and output over input."""
    outputs = dict.fromkeys(one["output_name"] for one in data["records"])
    loops: list[Block] = []
    for name in outputs:
        records = [one for one in data["records"] if one["output_name"] == name][:MOST]
        unit = display_unit(records[0]["output_unit"], np.concatenate([one["measured"] for one in records]))
        periodic = [one for one in records if one["frequency"] is not None]
        loops += [_loops(periodic, unit)] if periodic else []
    blocks: list[Block] = [*hold_out_blocks(data["shrinkage"]), _errors(data), *loops]
    keys = ("nrmsd_before", "nrmsd_after", "noise_floor", "shrinkage", "records")
    return Section("shrinkage", "How far it shrinks", blocks, {key: data[key] for key in keys})


def _most_improved(data: Mapping[str, Any]) -> str:
    before, after = data["nrmsd_before"], data["nrmsd_after"]
    test = max(before, key=lambda one: before[one] - after[one])
    return (
        f"The error falls most in {test}: from {percent(before[test])} to {percent(after[test])} "
        f"(noise floor {percent(data['noise_floor'][test])})."
    )


def _errors(data: Mapping[str, Any]) -> Figure:
    tests = list(data["nrmsd_before"])
    legend = [band_key(colour, label, 1.0) for _, label, colour in MODELS]
    panels = Panels(1, 1, 1.9, legend=[*legend, line_key(FLOOR, "noise floor")], margin=(0.75, 0.75, 0.1))
    axes = panels.axes[0]
    x = axis_of_tests(axes, tests)
    for offset, (key, model, colour) in zip((-0.2, 0.2), MODELS, strict=True):
        bars = axes.bar(x + offset, [100 * data[f"nrmsd_{key}"][test] for test in tests], 0.38, color=colour)
        keyed(bars.patches[0], model=model, test=[test_of(test) for test in tests])
    floors = [100 * data["noise_floor"][test] for test in tests]
    axes.hlines(floors, x - 0.42, x + 0.42, color=FLOOR, lw=1.6)
    panels.label(y="NRMSD (%)")
    return panels.figure(
        "NRMSD per test before and after",
        "Error per test without effects and with the best model. Both are fitted to all tests. An error near the noise "
        "floor can still hide a gap: the gap repeats, the noise does not.",
        good="blue equals the noise floor in every test.",
        bad="blue is well above it somewhere.",
        finding=_most_improved(data),
    )


def _loops_apart(records: Sequence[Mapping[str, Any]]) -> str:
    """The test whose loop the effect changes most."""
    apart = [
        float(np.ptp(np.asarray(one["after"]) - np.asarray(one["before"])) / (np.ptp(one["measured"]) or 1.0))
        for one in records
    ]
    k = int(np.argmax(apart))
    return f"The best model changes the loop of {records[k]['test']} most: by up to {percent(apart[k])} of its range."


def _loops(records: Sequence[Mapping[str, Any]], unit: Unit) -> Figure:
    dashes = dict(zip((BEFORE, AFTER), ("--", "-"), strict=True))
    lines = [line_key(colour, label, ls=dashes[label]) for _, label, colour in MODELS]
    legend = [dot_key(MEASURED, "measured", marker="."), *lines]
    panels = Panels(len(records), COLUMNS, 1.75, legend=legend, **_LAYOUT)
    for axes, one in zip(panels.axes, records, strict=True):
        x = display_unit(one["input_unit"], one["input"])
        values = x.factor * np.asarray(one["input"])
        measured, before, after = (unit.factor * np.asarray(one[key]) for key in ("measured", "before", "after"))
        axes.plot(values, measured, color=MEASURED, ls="none", marker=".", ms=3.2)
        (dashed,) = axes.plot(values, before, color=BASELINE, ls="--", lw=1.2)
        (line,) = axes.plot(values, after, color=mode_colour(0), lw=1.4)
        keyed(dashed, model=BEFORE)
        keyed(line, model=AFTER)
        panel_of(axes, one["test"])
        axes.set_xlabel(x.label(one["input_name"]), labelpad=1)
    panels.label(y=unit.label(records[0]["output_name"]))
    return panels.figure(
        "Loops of output over input, measured and simulated, before and after",
        "Output over input in the last period of each test.",
        good="the blue line runs through the middle of the measured points.",
        bad="the blue line is no better than the dashed one.",
        finding=_loops_apart(records),
    )


def closing_section(data: Mapping[str, Any]) -> Section:
    """How the numbers come about."""
    floors = ", ".join(f"{test} {percent(floor, 2)}" for test, floor in data["noise_floor"].items())
    return method_section(
        {
            "Whitening": "The spectral lines of every test are scaled to unit variance of its noise. Noise is what "
            "differs from period to period.",
            "Baseline": "The model without effects is fitted, with the calibration stages as priors.",
            "Score tests": "Every effect is tested at the baseline. The score statistic says how much of the residual "
            "its first-order change of the output explains beside the model's parameters.",
            "Refits": "The promising effects are fitted in full, alone and together. An extended Bayesian information "
            "criterion compares the models. It charges for every parameter and for the selection.",
            "Residual tests": "The residual of the best model is tested class by class and line by line. If much more "
            "than noise is left, the effect explains the gap in part, or none of the known effects does.",
            "Proposed term": "Where no known effect explains the gap, forward selection among powers, products, "
            "thresholds, lags and hystereses of inputs and states looks for what does. Cross-validation decides on the "
            "quantity that it acts on and on the number of terms. It is fitted jointly with the parameters.",
            "Hold-outs": "Each test, and whole groups of tests, are predicted by fits to the others, without and with "
            "the effect; records held out by fits that never saw them. A group is the tests of largest amplitude or "
            "highest frequency (within a factor of √2 of the largest), or of one procedure.",
            "Noise floor (NRMSD)": f"{floors}.",
            "Processor time": f"{data['seconds']:.1f} s.",
        },
        [
            "Ljung: System Identification. Theory for the User. 2nd edition, chapter 16 (1999).",
            "Pintelon, Schoukens: System Identification. A Frequency Domain Approach. 2nd edition (2012).",
            "Davies: Hypothesis testing when a nuisance parameter is present only under the alternative. "
            "Biometrika 74 (1987).",
            "Chen, Chen: Extended Bayesian information criteria for model selection with large model spaces. "
            "Biometrika 95 (2008).",
        ],
    )
