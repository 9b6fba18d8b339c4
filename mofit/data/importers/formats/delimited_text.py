"""Text tables: any usual delimiter, header or none, gzip or not."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.clock import clock_seconds, is_clock, joined
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat, ImportLimits
from mofit.errors import InputError
from mofit.units import is_unit

_DELIMITERS = ("\t", ";", ",")
_COMMENTS = ("#", "%")
#: lines that the dialect is found from
_LOOK = 50
_MOST_COLUMNS = 20_000


def text_columns(path: Path) -> Columns:
    """Columns of a text table by their header; without a header they are called "1", "2" and so on.

    Delimiter (tabulator, semicolon, comma, white space), decimal sign and header lines are found from the first lines;
    lines that begin with ``#`` or ``%`` are skipped. An empty or unreadable cell is NaN. A name that is used twice is
    followed by its number: ``F (4)``. A second header line is taken for units if all its cells are. A column of date
    and time becomes seconds since its first row.

    Raises
    ------
    InputError
        If the file is damaged or holds no table of numbers.
    """
    import pandas as pd  # heavy, and plans read nothing with it

    where = f"file '{path.name}'"
    lines = [line for line in file_text(path).splitlines() if line.strip() and not line.startswith(_COMMENTS)]
    if any(joined(line) != line for line in lines[:_LOOK]):
        lines = [joined(line) for line in lines]
    delimiter, decimal = _dialect(lines[:_LOOK])
    rows = [_split(line, delimiter) for line in lines[:_LOOK]]
    first = next((k for k, row in enumerate(rows) if _numeric(row, decimal)), None)
    if first is None:
        raise InputError.of(where, "holds no row of numbers", "Check that it is a text table")
    if len(rows[first]) > _MOST_COLUMNS:
        what = f"has {len(rows[first])} columns, more than {_MOST_COLUMNS}"
        raise InputError.of(where, what, "Give one row per time stamp")
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(lines[first:])),
            sep=delimiter or r"\s+",
            decimal=decimal,
            header=None,
            low_memory=False,
        )
    except (pd.errors.ParserError, OverflowError, MemoryError) as error:
        raise InputError.of(where, f"no regular table: {error}", "Give every row the same number of cells") from error
    header = rows[0] if first else []
    columns: dict[str, FloatArray] = {}
    clocks: dict[str, str] = {}
    for k in frame.columns:
        name = header[k] if k < len(header) else ""
        values, is_time = _numbers(f"{where}, column {k + 1}", frame[k], decimal)
        # a delimiter at the end of every line makes a last column without name and numbers
        if name or not np.all(np.isnan(values)):
            name = f"{name} ({k + 1})" if name in columns else name or str(k + 1)
            columns[name] = values
            clocks |= {name: "s"} if is_time else {}
    given = rows[1] if first > 1 and all(not cell or is_unit(cell) for cell in rows[1]) else []
    units = {name: unit for name, unit in zip(header, given, strict=False) if name in columns and unit}
    return columns, units | clocks


def _numbers(where: str, cells: Any, decimal: str) -> tuple[FloatArray, bool]:
    """Numbers of a column of a data frame, and whether they are the seconds of a clock."""
    import pandas as pd

    if not pd.api.types.is_numeric_dtype(cells):
        filled = cells.astype(object).where(cells.notna(), None)
        if (seconds := clock_seconds(filled)) is not None:
            return seconds, True
        if decimal != ".":
            # one cell of text leaves the whole column as text, its decimal signs included
            cells = cells.map(lambda cell: cell.replace(decimal, ".") if isinstance(cell, str) else cell)
    try:
        return pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float), False
    except OverflowError as error:
        raise InputError.of(where, str(error), "Correct the cell or cut the row") from error


def file_text(path: Path, limits: ImportLimits = LIMITS) -> str:
    """Text of a file, gzip or not, in UTF-8 or else Latin-1.

    Raises
    ------
    InputError
        If the gzip file is damaged, or the text is longer than the limits allow.
    """
    data = path.read_bytes()
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.open(io.BytesIO(data)) as file:
                data = file.read(limits.unpacked + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError.of(f"file '{path.name}'", f"damaged gzip file ({error})", "Copy it again") from error
    if len(data) > limits.unpacked:
        what = f"unpacks to more than {limits.unpacked} bytes"
        raise InputError.of(f"file '{path.name}'", what, "Split it into one file per test")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _dialect(lines: list[str]) -> tuple[str | None, str]:
    """Delimiter (None: white space) and decimal sign under which most lines are numbers."""
    tries = [
        (delimiter, decimal) for delimiter in (*_DELIMITERS, None) for decimal in (".", ",") if delimiter != decimal
    ]

    def numbers(dialect: tuple[str | None, str]) -> int:
        delimiter, decimal = dialect
        return sum(len(row) for row in (_split(line, delimiter) for line in lines) if _numeric(row, decimal))

    # "1,5" alone is one number or two: the earlier try, two columns, wins a draw
    return max(tries, key=numbers)


def _split(line: str, delimiter: str | None) -> list[str]:
    return [cell.strip().strip("\"'").strip() for cell in line.strip("\r\n ").split(delimiter)]


def _numeric(cells: list[str], decimal: str) -> bool:
    """At least one number, and nothing but numbers, clocks and empty cells."""
    try:
        return bool([float(cell.replace(decimal, ".")) for cell in cells if cell and not is_clock(cell)])
    except ValueError:
        return False


FORMAT = ImportFormat(
    name="text table",
    versions="any usual delimiter, decimal comma, header or none",
    endings=(".csv", ".txt", ".dat", ".asc", ".tsv"),
    columns="every column; a name used twice is followed by its number, `F (4)`; date and time are seconds since the "
    "first row",
    units="a second header line, if all its cells are units; a clock has s",
    read=text_columns,
)
