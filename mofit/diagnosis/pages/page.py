"""The diagnosis page: its sections in order, the verdict first and the method last."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from markupsafe import Markup

from mofit.diagnosis.pages.data import page_data
from mofit.diagnosis.pages.effects import effects_section, ruled_out_section
from mofit.diagnosis.pages.shrinkage import shrinkage_section
from mofit.diagnosis.pages.where import homogeneity_section, where_section
from mofit.diagnosis.result import Diagnosis
from mofit.report import Page
from mofit.report.toolkit.blocks import Block, Section, Text, banner, cards, method_section
from mofit.report.toolkit.formatting import THIN, display_unit, number, percent
from mofit.report.toolkit.page import draw_sections, write_json, write_page

PAGE_FILE = "diagnosis.html"
DATA_FILE = "diagnosis.json"
_GRADES = {"none": "good", "effect": "good", "group": "bad", "several": "good", "unknown": "bad"}


def diagnosis_page(diagnosis: Diagnosis) -> Page:
    """The page of a diagnosis, to be seen in a notebook; nothing is kept on disk."""
    with TemporaryDirectory() as folder:
        return Page(write_diagnosis(diagnosis, Path(folder)).read_text(encoding="utf-8"))


def write_diagnosis(diagnosis: Diagnosis, folder: Path) -> Path:
    """Write ``diagnosis.html`` and the numbers behind it, ``diagnosis.json``, into an existing folder.

    Returns
    -------
    Path
        The page. Style, script and figures are inside; nothing is fetched.
    """
    data = page_data(diagnosis)
    sections = draw_sections(
        [
            verdict_section,
            where_section,
            effects_section,
            shrinkage_section,
            ruled_out_section,
            homogeneity_section,
            closing_section,
        ],
        data,
    )
    write_json(folder / DATA_FILE, data)
    source = f"{data['model_title']} · {data['campaign']} ({data['source']})"
    return write_page(folder / PAGE_FILE, "Diagnosis of the gap", source, sections)


def verdict_section(data: Mapping[str, Any]) -> Section:
    """The verdict in a sentence, the few numbers that matter, and what follows from them."""
    where, shrinkage = data["where"], data["shrinkage"]
    unit = display_unit(where["unit"], where["gap"])
    key_figures = [(f"{number(unit.factor * where['gap'])}{THIN}{unit.name}", "gap, root mean square over all tests")]
    if where["residuals"]:
        key_figures.append((percent(where["of_peak"]), "of the output's peak, where the gap is largest"))
    if shrinkage:
        interval = f"{percent(shrinkage['low'])} to {percent(shrinkage['high'])}"
        removed = f"of the gap removed on held-out tests (90 % interval: {interval})"
        key_figures.append((percent(shrinkage["refitted"]), removed))
        key_figures.append((percent(shrinkage["predicted"]), "predicted by the score test, before any refit"))
    blocks: list[Block] = [banner(data["sentence"], _GRADES[data["verdict"]]), cards(key_figures)]
    if not shrinkage:
        blocks.append(Text(f"No share of the gap that goes is reported: {data['shrinkage_reason']}."))
    if data["next_experiment"]:
        blocks.append(Text(Markup("<b>What to test next.</b> {}").format(data["next_experiment"]["sentence"])))
    keys = ("verdict", "sentence", "effects", "group", "shrinkage", "shrinkage_reason", "next_experiment")
    return Section("summary", "Verdict", blocks, {key: data[key] for key in keys})


def closing_section(data: Mapping[str, Any]) -> Section:
    """How the numbers come about."""
    floors = ", ".join(f"{test} {percent(floor, 2)}" for test, floor in data["noise_floor"].items())
    return method_section(
        {
            "Whitening": "The spectral lines of every test are scaled to unit variance of its noise. The noise is what "
            "differs from period to period.",
            "Baseline": "The model without effects is fitted, with the calibration stages as priors.",
            "Score tests": "Every effect is tested at the baseline: how much of the residual its first-order change of "
            "the output explains beside the model's parameters.",
            "Refits": "The promising effects are fitted in full, alone and together. An extended Bayesian information "
            "criterion compares the models: it charges for every parameter and for the selection.",
            "Residual tests": "The residual of the best model is tested class by class and line by line. If it is more "
            "than noise, the verdict is that none of the known effects explains the gap.",
            "Held-out tests": "Each test is predicted by fits to the others, without and with the effect.",
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
