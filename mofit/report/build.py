"""From a run folder to its report: one page, and the numbers behind it as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr

from mofit.report.calibration import calibration_section
from mofit.report.convergence import convergence_section
from mofit.report.drawing import Maker, draw_sections
from mofit.report.error_per_test import error_section
from mofit.report.making import making_section
from mofit.report.method import method_section
from mofit.report.overlay import overlay_section
from mofit.report.page import Section, render
from mofit.report.parameter_table import parameter_section
from mofit.report.per_frequency import per_frequency_section
from mofit.report.posterior import posterior_section
from mofit.report.run import Run
from mofit.report.search_map import search_section
from mofit.report.style import RC
from mofit.report.summary import summary_section
from mofit.report.uncertainty import UNCERTAINTY_SECTIONS
from mofit.result import atomic_path, open_result

REPORT_FILE = "report.html"
DATA_FOLDER = "report_data"
UNCERTAINTY_FILE = "uncertainty.html"
UNCERTAINTY_FOLDER = "uncertainty_data"


@dataclasses.dataclass(frozen=True)
class _Page:
    """A file, the folder of the numbers behind it, what its title begins with, and its sections in order."""

    file: str
    data: str
    lead: str
    makers: Sequence[Maker]


_SECTIONS = (
    summary_section,
    parameter_section,
    error_section,
    overlay_section,
    search_section,
    per_frequency_section,
    posterior_section,
    calibration_section,
    convergence_section,
    making_section,
    method_section,
)
"""In the order of the page; a section that finds nothing to show returns None."""

_LONGEST = (posterior_section, overlay_section)
"""More than half of the work."""

_REPORT = _Page(REPORT_FILE, DATA_FOLDER, "", _SECTIONS)
_UNCERTAINTY = _Page(UNCERTAINTY_FILE, UNCERTAINTY_FOLDER, "Uncertainty: ", UNCERTAINTY_SECTIONS)


def build_report(folder: Path | str) -> Path:
    """Write ``report.html`` and ``report_data/*.json`` into a run folder, from its ``result.nc`` alone.

    Parameters
    ----------
    folder
        The run folder.

    Returns
    -------
    Path
        The page. It stands alone: style, script and figures are inside, nothing is fetched.

    Raises
    ------
    InputError
        If the folder has no readable ``result.nc``; nothing is written then.
    """
    return write_report(open_result(folder), _folder(folder))


def write_report(tree: xr.DataTree, folder: Path | str, processes: int | None = None) -> Path:
    """The same from a ``mofit.result/1`` tree that is in memory already, into an existing folder.

    Parameters
    ----------
    tree, folder
        The result and the folder.
    processes
        How many draw; see `draw_sections`.
    """
    return _write(_REPORT, tree, Path(folder), processes)


def build_uncertainty(folder: Path | str, tree: xr.DataTree | None = None) -> Path:
    """Write ``uncertainty.html`` and ``uncertainty_data/*.json`` into a run folder; see `build_report`.

    Parameters
    ----------
    folder
        The run folder.
    tree
        Its result, if it is in memory already.
    """
    return _write(_UNCERTAINTY, open_result(folder) if tree is None else tree, _folder(folder))


def _folder(source: Path | str) -> Path:
    """The run folder, of which ``result.nc`` may be named instead."""
    path = Path(source)
    return path.parent if path.is_file() else path


def _write(page: _Page, tree: xr.DataTree, folder: Path, processes: int | None = None) -> Path:
    run = Run(tree)
    with mpl.rc_context(RC):
        sections = draw_sections(run, page.makers, processes, _LONGEST)
    _write_data(sections, folder / page.data)
    file = folder / page.file
    with atomic_path(file) as temporary:
        text = render(page.lead + str(run.tree.attrs["title"]), _subtitle(run), sections)
        temporary.write_text(text, encoding="utf-8")
    return file


def _subtitle(run: Run) -> str:
    attrs = run.tree.attrs
    campaign, source = str(attrs["campaign_title"]), f"({attrs['campaign_source']})"
    told = campaign if source in campaign else f"{campaign} {source}"
    return f"{attrs['model_title']} · {told} · {attrs['created']}"


def _write_data(sections: Sequence[Section], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    names = {f"{section.id}.json" for section in sections if section.data}
    for section in sections:
        if section.data:
            with atomic_path(folder / f"{section.id}.json") as temporary:
                temporary.write_text(json.dumps(plain(section.data), allow_nan=False), encoding="utf-8")
    for old in folder.glob("*.json"):
        if old.name not in names:
            old.unlink()


def plain(value: Any) -> Any:
    """Dataclasses and arrays as JSON values; what is not a finite number becomes null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isfinite(value).all():
        return value.tolist()
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
