"""From a run folder or a result to its pages, each one file with the numbers behind it as JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from mofit.errors import InputError
from mofit.results import is_large, open_result
from mofit.runtime.output_file import output_file
from mofit.runtime.parallel import ready_beside

if TYPE_CHECKING:
    from mofit.report.toolkit.blocks import Section

REPORT_FILE = "report.html"
DATA_FOLDER = "report_data"
UNCERTAINTY_FILE = "uncertainty.html"
UNCERTAINTY_FOLDER = "uncertainty_data"
_PAGES = {
    "report": (REPORT_FILE, DATA_FOLDER, ""),
    "uncertainty": (UNCERTAINTY_FILE, UNCERTAINTY_FOLDER, "Uncertainty: "),
}
"""File, folder of the numbers behind it, and what its title begins with."""

#: Figures are drawn in Python, a core at a time; a second process halves the wait, more would mostly start up.
_PROCESSES = 2
#: Height of a page's frame in a notebook [CSS pixels]; the page scrolls inside it.
_HEIGHT = 720


#: ``with drawn(tree, folder): write_result(tree, folder)``: after the block the report is drawn.
Drawn = Callable[[xr.DataTree, Path], AbstractContextManager[None]]


def build_report(folder: Path | str) -> Path:
    """Write ``report.html`` and ``report_data/*.json`` into a run folder, from its ``result.nc`` alone.

    The page, which is returned, stands alone: style, script and figures are inside, nothing is fetched.

    Raises
    ------
    InputError
        If the folder has no readable ``result.nc``, or cannot be written to; nothing is written then.
    """
    return _rebuilt("report", folder)


def write_report(tree: xr.DataTree, folder: Path | str) -> Path:
    """The same from a ``mofit.result/2`` tree that is in memory already, into an existing folder."""
    return _write("report", tree, Path(folder))


def build_uncertainty(folder: Path | str, tree: xr.DataTree | None = None) -> Path:
    """Write ``uncertainty.html`` and ``uncertainty_data/*.json`` into a run folder; see `build_report`.

    `tree` is its result, if that is in memory already.
    """
    return _rebuilt("uncertainty", folder, tree)


@contextmanager
def report_beside() -> Iterator[Drawn]:
    """A process that gets ready to draw while the caller computes, and draws the report while the caller writes.

    A large result is not sent to it, but read from its file once that is written.
    """
    with ready_beside(_get_ready) as start:

        @contextmanager
        def drawn(tree: xr.DataTree, folder: Path) -> Iterator[None]:
            if is_large(tree):  # on the way there would be three of it in memory
                yield
                start(_from_file, folder)()
                return
            finished = start(write_report, tree, folder)
            try:
                yield
            finally:  # also after an error: nothing else may write into the folder then
                finished()

        yield drawn


def _from_file(folder: Path) -> None:
    write_report(open_result(folder), folder)


@dataclass(frozen=True)
class Page:
    """A page of HTML that stands alone; the last line of a notebook's cell shows it.

    It stands in a frame of its own, so that neither's style reaches the other.
    """

    html: str

    def _repr_html_(self) -> str:
        # links within the page would otherwise lead to the notebook's address
        inside = self.html.replace("<head>", '<head><base href="about:srcdoc">', 1)
        return (
            f'<iframe srcdoc="{escape(inside)}" sandbox="allow-scripts" loading="lazy" '
            f'style="width: 100%; height: {_HEIGHT}px; border: 0" title="mofit"></iframe>'
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
    from mofit.report.toolkit.page import render

    if kind not in _PAGES:
        raise InputError.of(f"page '{kind}'", "there is no such page", f"Use one of {', '.join(_PAGES)}")
    return Page(render(*_drawn(kind, run if isinstance(run, xr.DataTree) else open_result(run))))


def _folder(source: Path | str) -> Path:
    """The run folder, of which ``result.nc`` may be named instead."""
    path = Path(source)
    return path.parent if path.is_file() else path


def _rebuilt(kind: str, source: Path | str, tree: xr.DataTree | None = None) -> Path:
    """A page of a finished run, in place of an earlier one; its place is claimed before it is drawn."""
    tree = open_result(source) if tree is None else tree
    folder = _folder(source)
    with output_file(folder / _PAGES[kind][0], kind, force=True):
        return _write(kind, tree, folder)


def _write(kind: str, tree: xr.DataTree, folder: Path) -> Path:
    from mofit.report.toolkit.page import write_data, write_page

    file, data, _ = _PAGES[kind]
    title, subtitle, sections = _drawn(kind, tree)
    write_data(folder / data, sections)
    return write_page(folder / file, title, subtitle, sections)


def _drawn(kind: str, tree: xr.DataTree) -> tuple[str, str, list[Section]]:
    """Title, subtitle and sections of a page."""
    from mofit.report.contents import CONTENTS, LONGEST
    from mofit.report.run import Run
    from mofit.report.toolkit.page import draw_sections

    attrs = tree.attrs
    campaign, source = str(attrs["campaign_title"]), f"({attrs['campaign_source']})"
    named = campaign if source in campaign else f"{campaign} {source}"
    return (
        _PAGES[kind][2] + str(attrs["title"]),
        f"{attrs['model_title']} · {named} · {attrs['created']}",
        draw_sections(CONTENTS[kind], Run(tree), processes=_PROCESSES, first=LONGEST),
    )


def _get_ready() -> None:
    """Import what draws, and draw once what is slow the first time."""
    import mofit.report.contents  # noqa: F401 - imported for later
    from mofit.report.toolkit.figures import warm_up

    warm_up()
