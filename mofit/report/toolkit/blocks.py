"""What a page is made of: sections of text, tables, figures and tabs, each with the numbers behind it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup

from mofit.report.toolkit.formatting import symbol, unit_text


@dataclass(frozen=True)
class Text:
    """A paragraph; a plain string is escaped."""

    html: Markup | str
    kind: str = "text"


@dataclass(frozen=True)
class Raw:
    """Markup that is no paragraph: a banner, a row of cards, a list."""

    html: Markup
    kind: str = "raw"


@dataclass(frozen=True)
class Column:
    """A column of a table: its head and its cells from top to bottom; cells are escaped unless they are `Markup`.

    Columns of words are aligned left, columns of numbers right.
    """

    head: Markup | str
    cells: Sequence[Markup | str]
    words: bool = False


def words(head: Markup | str, cells: Iterable[Markup | str]) -> Column:
    """A column of words."""
    return Column(head, list(cells), words=True)


def parameter_column(names: Iterable[str]) -> Column:
    """The column of parameters, by their symbols."""
    return Column("Parameter", [symbol(name) for name in names])


def unit_column(units: Iterable[str]) -> Column:
    """The column of their units."""
    return words("Unit", [unit_text(unit) for unit in units])


def wrapped(text: Markup | str) -> Markup:
    """A cell that may break into lines."""
    return Markup('<span class="words">{}</span>').format(text)


@dataclass(frozen=True)
class Table:
    """A table by columns of equal length; the first names the row. Without any head the table has no head row.

    Raises
    ------
    ValueError
        If the columns differ in length.
    """

    columns: Sequence[Column]
    caption: Markup | str = ""
    kind: str = "table"

    def __post_init__(self) -> None:
        if len({len(column.cells) for column in self.columns}) > 1:
            lengths = ", ".join(f"{column.head}: {len(column.cells)}" for column in self.columns)
            raise ValueError(f"columns of a table differ in length: {lengths}")

    @property
    def rows(self) -> list[tuple[Markup | str, ...]]:
        """The cells row by row."""
        return list(zip(*(column.cells for column in self.columns), strict=True))

    @property
    def headed(self) -> bool:
        """Whether any column has a head."""
        return any(column.head for column in self.columns)


@dataclass(frozen=True)
class Figure:
    """A drawing with a caption that says what to see, and what good and bad look like; made by `Panels.figure`.

    `finding` is what is to be seen in this one; `described` what it is drawn from, None where it can't be explored.
    `size` is width and height in pixels: a page keeps the place of a picture that comes later.
    """

    image: str
    alt: str
    caption: Markup | str
    good: Markup | str = ""
    bad: Markup | str = ""
    finding: Markup | str = ""
    described: Mapping[str, Any] | None = None
    size: tuple[int, int] = (1075, 400)
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


def banner(text: Markup | str, grade: str) -> Raw:
    """The outcome in one coloured box, `good` or `bad`; a bad one is announced to screen readers."""
    role = "alert" if grade == "bad" else "status"
    return Raw(Markup('<div class="banner {}" role="{}">{}</div>').format(grade, role, text))


def cards(items: Iterable[tuple[Markup | str, Markup | str]]) -> Raw:
    """Key figures in a row: the figure large, what it is below."""
    card = Markup('<div class="card"><b>{}</b><span>{}</span></div>')
    return Raw(Markup('<div class="cards">{}</div>').format(Markup("").join(card.format(*item) for item in items)))


def bullets(items: Iterable[Markup | str], lead: Markup | str = "") -> Raw:
    """A list, after a sentence that introduces it."""
    return Raw((Markup("<p>{}</p>").format(lead) if lead else Markup("")) + _list("ul", items))


def badge(text: str, grade: str) -> Markup:
    """A small coloured label: `good`, `fair`, `bad` or `unknown`."""
    return Markup('<span class="badge {}">{}</span>').format(grade, text)


def swatch(colour: str, text: Markup | str) -> Markup:
    """A text with a swatch of its colour before it."""
    return Markup('<span class="key" style="background:{}"></span>{}').format(colour, text)


def method_section(
    steps: Mapping[str, Markup | str], references: Sequence[str] = (), more: Sequence[Block] = ()
) -> Section:
    """The section that closes a page: how its numbers come about, each step under its name, and the sources."""
    blocks: list[Block] = [Text(Markup("<b>{}.</b> {}").format(name, text)) for name, text in steps.items()]
    if references:
        blocks.append(Raw(_list("ol", references)))
    return Section("method", "Method", [*blocks, *more])


def _list(tag: str, items: Iterable[Markup | str]) -> Markup:
    inner = Markup("").join(Markup("<li>{}</li>").format(item) for item in items)
    return Markup("<{0}>{1}</{0}>").format(Markup(tag), inner)
