"""What a report page is made of: sections of text, tables, figures and tabs, each with the numbers behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import jinja2
from markupsafe import Markup


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    html: Markup | str
    kind: str = "text"


@dataclass(frozen=True)
class Raw:
    """Markup that is no paragraph: a banner, a row of cards."""

    html: Markup
    kind: str = "raw"


@dataclass(frozen=True)
class Table:
    """A table; the first column names the row, cells are escaped unless they are `Markup`.

    The columns at the places in `left` hold words and are aligned left, the others hold numbers. Without `columns` the
    table has no head.
    """

    columns: Sequence[Markup | str]
    rows: Sequence[Sequence[Markup | str]]
    caption: Markup | str = ""
    left: Sequence[int] = ()
    kind: str = "table"


@dataclass(frozen=True)
class Figure:
    """A drawing with a caption that says what to see, and what good and bad look like."""

    image: str
    alt: str
    caption: Markup | str
    good: Markup | str = ""
    bad: Markup | str = ""
    kind: str = "figure"


@dataclass(frozen=True)
class Tabs:
    """Alternatives of which one is shown at a time (all of them, with titles, where scripts are off)."""

    panes: Mapping[str, Sequence[Block]]
    kind: str = "tabs"


@dataclass(frozen=True)
class Details:
    """Blocks that open on request."""

    title: str
    blocks: Sequence[Block]
    kind: str = "details"


Block = Text | Raw | Table | Figure | Tabs | Details


@dataclass(frozen=True)
class Section:
    """A part of the page; `data` holds the numbers behind its tables and figures in SI units."""

    id: str
    title: str
    blocks: Sequence[Block]
    data: Mapping[str, Any] = field(default_factory=dict)


def tabs(panes: Mapping[str, Sequence[Block]]) -> Sequence[Block]:
    """The panes as tabs, or the bare blocks of a single one."""
    if len(panes) == 1:
        return next(iter(panes.values()))
    return [Tabs(panes)]


def render(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page as self-contained HTML: style, script and images are inside."""
    folder = resources.files(__package__)
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    inline = {name: Markup((folder / name).read_text(encoding="utf-8")) for name in ("page.css", "page.js")}
    return environment.get_template("page.html.j2").render(
        title=title, subtitle=subtitle, sections=sections, style=inline["page.css"], script=inline["page.js"]
    )
