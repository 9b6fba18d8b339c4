"""The page of a comparison of procedures: one table first, then why."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mofit.identifiability.compare_page.branch import branch_section
from mofit.identifiability.compare_page.carried import carried_section
from mofit.identifiability.compare_page.frequency import frequency_section
from mofit.identifiability.compare_page.method import method_section
from mofit.identifiability.compare_page.profile_curves import profile_section
from mofit.identifiability.compare_page.table import table_section
from mofit.identifiability.compare_page.together import together_section
from mofit.identifiability.comparison import Comparison
from mofit.report.page import render
from mofit.report.style import RC
from mofit.result import atomic_path

_SECTIONS = (
    carried_section,
    frequency_section,
    branch_section,
    together_section,
    profile_section,
    method_section,
)
"""After the table, in order; a section that finds nothing to show returns None."""


def write_comparison(comparison: Comparison, mends: Sequence[str], path: Path) -> Path:
    """Write the page of a comparison, self-contained.

    Parameters
    ----------
    comparison
        What is shown.
    mends
        What would make parameters identifiable that no procedure identifies, in sentences.
    path
        The file, replaced if it exists.
    """
    import matplotlib as mpl

    with mpl.rc_context(RC):
        drawn = [make(comparison) for make in _SECTIONS]
    sections = [table_section(comparison, mends), *(section for section in drawn if section is not None)]
    source = comparison.told[0].source
    files = ", ".join(told.source.name for told in comparison.told)
    title = source.model.title or source.model.name
    with atomic_path(path) as temporary:
        temporary.write_text(render("Which test tells what", f"{title} · {files}", sections), encoding="utf-8")
    return path
