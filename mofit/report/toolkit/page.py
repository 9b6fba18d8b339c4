"""From the sections of a page to its file.

How a page is made, here and in the packages above::

    def errors_section(run: Run) -> Section | None:        # extract, then draw; None where there is nothing to show
        errors = extract_errors(run)                       # plain data, SI units
        table = Table([Column("Test", errors.tests),       # head and cells side by side; `words` for columns of words
                       Column("NRMSD", [percent(e) for e in errors.nrmsd])], "NRMSD per test.")
        return Section("errors", "Error per test", [errors_figure(errors), table], {"errors": errors})

    def errors_figure(errors: Errors) -> Figure:
        panels = Panels(1, 1, 2.7, legend=[line_key(mode_colour(0), "model")])
        x = axis_of_tests(panels.axes[0], errors.tests)
        panels.axes[0].plot(x, 100 * errors.nrmsd, color=mode_colour(0))
        panels.label(y="NRMSD (%)")
        return panels.figure("NRMSD per test", "What it is.", good="…", bad="…")

    sections = draw_sections([errors_section, …], run)     # in the look of all figures, on several cores if asked
    write_page(folder / "report.html", "Title", "subtitle", sections)
    write_data(folder / "report_data", sections)           # the `data` of every section as JSON

Blocks (`blocks.py`): Text, Raw, Column, words, wrapped, Table, Figure, Tabs, tabs, Details, Section, banner, cards,
bullets, badge, swatch, method_section. Figures (`figures.py`): Panels, line_key, dot_key, band_key, mode_colour,
colours. Axes (`axes.py`): few_ticks, log_axis, log_if_wide, axis_of_frequencies, axis_of_tests, heat_map. Numbers
(`formatting.py`): number, compact, count, with_sd, plus_minus, interval, percent, p_value, symbol, display_unit.
"""

from __future__ import annotations

import base64
import dataclasses
import gzip
import json
import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import jinja2
import numpy as np
from markupsafe import Markup

from mofit.report.toolkit.blocks import Section
from mofit.report.toolkit.description import offers
from mofit.report.toolkit.figures import styled
from mofit.runtime.files import atomic_path
from mofit.runtime.output_file import PAGE_MARK
from mofit.runtime.parallel import forked_map

T = TypeVar("T")


Maker = Callable[[T], Section | None]


def draw_sections(
    makers: Sequence[Maker[T]], source: T, *, processes: int = 1, first: Sequence[Maker[T]] = ()
) -> list[Section]:
    """The sections that find something to show in `source`, in order; the same for any number of processes.

    Parameters
    ----------
    makers, source
        What each section is made by, and from.
    processes
        How many draw, where the system can fork.
    first
        Makers that take longest: they are begun first.
    """
    with styled():
        drawn = forked_map(lambda make: make(source), makers, processes, first)
    return [section for section in drawn if section is not None]


def write_page(path: Path, title: str, subtitle: str, sections: Sequence[Section]) -> Path:
    """Write a page as self-contained HTML, at once: style, script and images are inside, nothing is fetched."""
    with atomic_path(path) as temporary:
        temporary.write_text(render(title, subtitle, sections), encoding="utf-8")
    return path


def render(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page as text."""
    folder = resources.files(__package__)
    scripts = ("page.js", "abreast.js", "choices.js", "brush.js", "labels.js", "figures.js")
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["packed"] = _packed_values
    environment.filters["offers"] = offers

    def inside(*names: str) -> Markup:
        return Markup("\n".join((folder / name).read_text(encoding="utf-8") for name in names))

    return environment.get_template("page.html.j2").render(
        title=title,
        subtitle=subtitle,
        sections=sections,
        mark=Markup(PAGE_MARK),
        style=inside("page.css"),
        script=inside(*scripts),
        library=_library(),
    )


@lru_cache
def _library() -> Markup:
    """The library that draws explored figures, packed."""
    return _packed((resources.files(__package__) / "vendor" / "plotly-cartesian.min.js").read_bytes())


def _packed_values(values: Any) -> Markup:
    return _packed(json.dumps(plain(values), allow_nan=False, separators=(",", ":")).encode())


def _packed(content: bytes) -> Markup:
    """As a browser unpacks it: gzip in base 64."""
    return Markup(base64.b64encode(gzip.compress(content, 6, mtime=0)).decode("ascii"))


def write_data(folder: Path, sections: Sequence[Section]) -> None:
    """Write the numbers behind every section into ``<id>.json`` of a folder; files of earlier sections go."""
    folder.mkdir(exist_ok=True)
    files = {folder / f"{section.id}.json": section.data for section in sections if section.data}
    for file, data in files.items():
        write_json(file, data)
    for old in set(folder.glob("*.json")) - set(files):
        old.unlink()


def write_json(path: Path, value: Any) -> None:
    """Write `plain` values as JSON, at once."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(plain(value), allow_nan=False), encoding="utf-8")


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
