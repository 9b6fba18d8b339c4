"""From the plain data of a diagnosis to its page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl

from mofit.report.build import plain
from mofit.report.diagnosis.agreement import agreement_section
from mofit.report.diagnosis.before_after import before_after_section
from mofit.report.diagnosis.gap_map import gap_section
from mofit.report.diagnosis.method import method_section
from mofit.report.diagnosis.ranking import ranking_section
from mofit.report.diagnosis.ruled_out import ruled_out_section
from mofit.report.diagnosis.verdict import verdict_section
from mofit.report.page import render
from mofit.report.style import RC
from mofit.result import atomic_path

DIAGNOSIS_FILE = "diagnosis.html"
DIAGNOSIS_DATA = "diagnosis.json"

_SECTIONS = (
    verdict_section,
    gap_section,
    ranking_section,
    before_after_section,
    ruled_out_section,
    agreement_section,
    method_section,
)


def write_diagnosis(data: Mapping[str, Any], folder: Path) -> Path:
    """Write ``diagnosis.html`` and the numbers behind it, ``diagnosis.json``, into an existing folder.

    Parameters
    ----------
    data
        What ``mofit diagnose --json`` prints, and what `mofit.diagnosis.page_data` adds.
    folder
        Where to.

    Returns
    -------
    Path
        The page. It stands alone: style, script and figures are inside, nothing is fetched.
    """
    with mpl.rc_context(RC):
        sections = [section for make in _SECTIONS if (section := make(data)) is not None]
    with atomic_path(folder / DIAGNOSIS_DATA) as temporary:
        temporary.write_text(json.dumps(plain(dict(data)), allow_nan=False), encoding="utf-8")
    source = f"{data['model_title']} · {data['campaign']} ({data['source']})"
    with atomic_path(folder / DIAGNOSIS_FILE) as temporary:
        temporary.write_text(render("Diagnosis of the gap", source, sections), encoding="utf-8")
    return folder / DIAGNOSIS_FILE
