"""Text tables: any usual delimiter, remarks, names and units above it or none, several blocks, gzip or not."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.clock import clock_seconds, joined
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat, ImportLimits
from mofit.data.importers.text_blocks import LOOK, Block, Dialect, find_blocks, find_dialect
from mofit.errors import InputError

_COMMENTS = ("#", "%")
_MOST_COLUMNS = 20_000


def text_columns(path: Path) -> Columns:
    """Columns of a text table by their header; without a header they are called "1", "2" and so on.

    Delimiter (tabulator, semicolon, comma, white space), decimal sign, names and units are found from the lines
    (`mofit.data.importers.text_blocks`); remarks above are passed over, and so are lines that begin with ``#`` or
    ``%``. An empty or unreadable cell is NaN. A name that is used twice is followed by its number: ``F (4)``. A clock
    becomes seconds since its first row. Of several blocks the columns are ``block.1.F``, ``block.2.F`` and so on.

    Raises
    ------
    InputError
        If the file is damaged or holds no table of numbers.
    """
    where = f"file '{path.name}'"
    lines = [line for line in file_text(path).splitlines() if line.strip() and not line.startswith(_COMMENTS)]
    if any(joined(line) != line for line in lines[:LOOK]):
        lines = [joined(line) for line in lines]
    dialect = find_dialect(lines[:LOOK])
    blocks = find_blocks(lines, dialect)
    if not blocks:
        raise InputError.of(where, "holds no row of numbers", "Check that it is a text table")
    longer = [block for block in blocks if len(block.rows) > 1] or blocks[:1]
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for number, block in enumerate(longer, 1):
        prefix = f"block.{number}." if len(longer) > 1 else ""
        own, own_units = _block_columns(where, block, dialect)
        columns |= {prefix + name: values for name, values in own.items()}
        units |= {prefix + name: unit for name, unit in own_units.items()}
    return columns, units


def _block_columns(where: str, block: Block, dialect: Dialect) -> Columns:
    import pandas as pd  # heavy, and plans read nothing with it

    if (width := len(dialect.split(block.rows[0]))) > _MOST_COLUMNS:
        raise InputError.of(where, f"has {width} columns, more than {_MOST_COLUMNS}", "Give one row per time stamp")
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(block.rows)),
            sep=dialect.delimiter or r"\s+",
            decimal=dialect.decimal,
            header=None,
            low_memory=False,
        )
    except (pd.errors.ParserError, OverflowError, MemoryError) as error:
        raise InputError.of(where, f"no regular table: {error}", "Give every row the same number of cells") from error
    columns: dict[str, FloatArray] = {}
    clocks: dict[str, str] = {}
    given: dict[str, str] = {}
    for k in frame.columns:
        name = block.names[k] if k < len(block.names) else ""
        values, is_time = _numbers(f"{where}, column {k + 1}", frame[k], dialect.decimal)
        # a delimiter at the end of every line makes a last column without name and numbers
        if name or not np.all(np.isnan(values)):
            name = f"{name} ({k + 1})" if name in columns else name or str(k + 1)
            columns[name] = values
            clocks |= {name: "s"} if is_time else {}
            if k < len(block.units) and block.units[k]:
                given[name] = block.units[k]
    return columns, given | clocks


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


FORMAT = ImportFormat(
    name="text table",
    versions="any usual delimiter, decimal comma, remarks and header or none, several blocks",
    endings=(".csv", ".txt", ".dat", ".asc", ".tsv"),
    columns="every column; a name used twice is followed by its number, `F (4)`; a clock is seconds since the first "
    "row; of several blocks `block.1.F`, `block.2.F`",
    units="a header line, if most of its cells are units; a clock has s",
    read=text_columns,
)
