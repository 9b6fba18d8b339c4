"""Pages inside a notebook: in a frame of their own, so that neither's style reaches the other."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

import xarray as xr

from mofit.errors import InputError
from mofit.report.build import REPORT_FILE, UNCERTAINTY_FILE, build_uncertainty, write_report
from mofit.result import open_result

#: height of the frame, in CSS pixels; the page scrolls inside it
HEIGHT = 720
KINDS = ("report", "uncertainty")


@dataclass(frozen=True)
class Page:
    """A page of HTML that stands alone; the last line of a notebook's cell shows it."""

    html: str

    def _repr_html_(self) -> str:
        # links within the page would otherwise lead to the notebook's address
        inside = self.html.replace("<head>", '<head><base href="about:srcdoc">', 1)
        return (
            f'<iframe srcdoc="{escape(inside)}" sandbox="allow-scripts" loading="lazy" '
            f'style="width: 100%; height: {HEIGHT}px; border: 0" title="mofit"></iframe>'
        )


def report_page(run: xr.DataTree | Path | str, kind: str = "report") -> Page:
    """The report of a run, to be seen in a notebook.

    Parameters
    ----------
    run
        A run's folder or its ``result.nc``, or the result itself from `mofit.open`.
    kind
        ``"report"`` or ``"uncertainty"``.

    Returns
    -------
    Page
        Shows itself in a notebook; its ``html`` is the page. Nothing is written.

    Raises
    ------
    InputError
        If there is no such run or no page of that kind.
    """
    if kind not in KINDS:
        raise InputError.of(f"page '{kind}'", "there is no such page", f"Say one of {', '.join(KINDS)}")
    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    with TemporaryDirectory() as name:
        folder = Path(name)
        if kind == "report":
            write_report(tree, folder)
        else:
            build_uncertainty(folder, tree)
        return Page((folder / (REPORT_FILE if kind == "report" else UNCERTAINTY_FILE)).read_text(encoding="utf-8"))
