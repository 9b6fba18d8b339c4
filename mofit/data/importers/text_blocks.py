"""The tables inside a text file as data loggers write it: lines of remarks, names, units, rows of numbers, blocks."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from mofit.data.importers.clock import is_clock, is_date
from mofit.units import is_unit

_DELIMITERS = ("\t", ";", ",")
#: lines that the dialect is found from
LOOK = 200
#: a line with any other sign may be no row of numbers
_TEXT = re.compile(r"[^\d\s.,;:+\-eE\"'/]")
#: longest cell that is looked up as a unit
_LONGEST_UNIT = 12


@dataclass(frozen=True)
class Dialect:
    """Delimiter (None: white space) and decimal sign of a table."""

    delimiter: str | None
    decimal: str

    def split(self, line: str) -> list[str]:
        """Cells of a line, without quotes."""
        line = line.strip("\r\n ")
        if self.delimiter is None:
            line = re.sub(r"(?<!\s)\s+(?=[\[(])", "", line)  # the unit of "force [kN]" is no cell of its own
        return [cell.strip().strip("\"'").strip() for cell in line.split(self.delimiter)]

    def numeric(self, cell: str) -> bool:
        """Whether a cell is a number, a clock or a date."""
        try:
            float(cell.replace(self.decimal, "."))
        except ValueError:
            return is_clock(cell) or is_date(cell)
        return True


@dataclass(frozen=True)
class Block:
    """A table: names and units of its columns, both may be empty, and its rows as they stand in the file."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: list[str]


def find_dialect(lines: Sequence[str]) -> Dialect:
    """The dialect under which the lines have the most cells that are numbers."""
    tries = [
        Dialect(delimiter, decimal)
        for delimiter in (*_DELIMITERS, None)
        for decimal in (".", ",")
        if delimiter != decimal
    ]

    def numbers(dialect: Dialect) -> int:
        found = 0
        for line in lines:
            given = [dialect.numeric(cell) for cell in dialect.split(line) if cell]
            text = given.count(False)
            if (more := len(given) - 2 * text) > 0:
                found += more
        return found

    # "1,5" alone is one number or two: the earlier try, two columns, wins a draw
    return max(tries, key=numbers)


def find_blocks(lines: Sequence[str], dialect: Dialect) -> list[Block]:
    """The tables of a file in their order; empty if no line is a row of numbers.

    The first row is the first line that has numbers where most lines have them. A later line without any number, or of
    another number of cells with text among them, ends a table; the names of the next one are those before it, else
    those of the table before. A single such line of the usual number of cells that is no header is a row: its cells
    were not readable.
    """
    first, width = _first_row(lines[:LOOK], dialect)
    if first is None:
        return []
    names, units = _header(lines[:first], dialect, width)
    header = {line.strip() for line in lines[:first]}
    breaks = [k for k in range(first + 1, len(lines)) if _is_break(lines[k], dialect, width)]
    runs = _runs(breaks)
    blocks, begin = [], first
    for start, stop in [*runs, (len(lines), len(lines))]:
        alone = stop - start == 1 and lines[start].strip() not in header
        if alone and stop < len(lines) and len(dialect.split(lines[start])) == width:
            continue
        blocks.append(Block(names, units, list(lines[begin:start])))
        if stop < len(lines):
            own = _header(lines[start:stop], dialect, len(_trimmed(dialect.split(lines[stop]))))
            names, units = own if own[0] else (names, units)
            begin = stop
        else:
            break
    return blocks


def _runs(indices: Sequence[int]) -> list[tuple[int, int]]:
    """Consecutive numbers as (first, last + 1)."""
    runs: list[tuple[int, int]] = []
    for k in indices:
        if runs and runs[-1][1] == k:
            runs[-1] = (runs[-1][0], k + 1)
        else:
            runs.append((k, k + 1))
    return runs


def _first_row(lines: Sequence[str], dialect: Dialect) -> tuple[int | None, int]:
    """Index of the first row of numbers, and the usual number of cells."""
    rows = [dialect.split(line) for line in lines]
    marks = [[dialect.numeric(cell) if cell else None for cell in row] for row in rows]
    likely = [mark for mark in marks if mark.count(True) and mark.count(True) >= mark.count(False)]
    if not likely:
        return None, 0
    width = Counter(len(mark) for mark in likely).most_common(1)[0][0]
    usual = [mark for mark in likely if len(mark) == width]
    numbers = [sum(mark[k] is True for mark in usual) >= 0.5 * len(usual) for k in range(width)]

    def is_row(mark: list[bool | None]) -> bool:
        return len(mark) == width and True in mark and all(mark[k] is not False for k in range(width) if numbers[k])

    found = next((k for k, mark in enumerate(marks) if is_row(mark)), None)
    return found, width


def _is_break(line: str, dialect: Dialect, width: int) -> bool:
    """Whether a line behind the first row is no row of numbers."""
    if not _TEXT.search(line):
        return False
    cells = dialect.split(line)
    given = [dialect.numeric(cell) for cell in cells if cell]
    return not any(given) or (len(cells) != width and not all(given))


def _header(lines: Sequence[str], dialect: Dialect, width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units in the lines right before a table; of lines of another length only the last may be names."""
    rows: list[list[str]] = []
    for line in reversed(lines):
        cells = dialect.split(line)
        if len(_trimmed(cells)) not in (width, width - 1) and len(cells) != width:
            break
        rows.insert(0, cells)
    if not rows:
        last = dialect.split(lines[-1]) if lines else []
        return (tuple(last), ()) if len(last) > 1 or width == 1 else ((), ())
    if len(rows) == 1:
        return tuple(rows[0]), ()
    if not _is_unit_row(rows[-1]) and _is_unit_row(rows[-2]) and len(rows) > 2 and not _distinct(rows[-1]):
        rows = rows[:-1]
    if _is_unit_row(rows[-1]):
        return tuple(rows[-2]), tuple(_plain(cell) for cell in rows[-1])
    names = next((row for row in reversed(rows) if _distinct(row) and not _is_unit_row(row)), rows[0])
    above = rows[rows.index(names) - 1] if rows.index(names) else []
    return tuple(names), tuple(_plain(cell) for cell in above) if above and _is_unit_row(above) else ()


def _trimmed(cells: Sequence[str]) -> Sequence[str]:
    """Cells without the empty ones at the end, which a delimiter at the end of a line makes."""
    end = len(cells)
    while end and not cells[end - 1]:
        end -= 1
    return cells[:end]


def _plain(cell: str) -> str:
    """A unit without brackets around it."""
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] + cell[-1] in ("[]", "()") else cell


def _is_unit_row(cells: Sequence[str]) -> bool:
    """Whether most cells that are not empty are units."""
    given = [cell for cell in cells if cell]
    known = [len(cell) <= _LONGEST_UNIT and is_unit(_plain(cell)) for cell in given]
    return bool(given) and known.count(True) > 0.6 * len(given)


def _distinct(cells: Sequence[str]) -> bool:
    given = [cell for cell in cells if cell]
    return len(set(given)) > 0.5 * len(given)
