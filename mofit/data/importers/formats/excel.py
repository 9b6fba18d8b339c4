"""Excel workbooks (.xlsx) through openpyxl."""

from __future__ import annotations

import zipfile
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.clock import clock_seconds
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat
from mofit.units import is_unit

_MOST_COLUMNS = 1000


def excel_columns(path: Path) -> Columns:
    """Columns of every sheet by their header; with several sheets of numbers they are called ``sheet.column``.

    The header is the line of text above the first row of numbers; where that line holds units, it is the one above.
    A column without a name is called by its number. Formulas have the value that was last computed. A cell that is no
    number is NaN; date and time are seconds since the first row.

    Raises
    ------
    Exception
        Whatever openpyxl raises on a damaged file.
    InputError
        If the file claims to be larger than it can hold.
    """
    from openpyxl import load_workbook

    with zipfile.ZipFile(path) as packed:
        LIMITS.check(path, sum(member.file_size for member in packed.infolist()))
    book = load_workbook(path, read_only=True, data_only=True)
    try:
        sheets = {
            sheet.title: _sheet([list(row) for row in sheet.iter_rows(values_only=True)]) for sheet in book.worksheets
        }
    finally:
        book.close()
    filled = {title: found for title, found in sheets.items() if found[0]}
    if len(filled) == 1:
        return next(iter(filled.values()))
    columns = {f"{title}.{name}": values for title, (found, _) in filled.items() for name, values in found.items()}
    return columns, {f"{title}.{name}": unit for title, (_, own) in filled.items() for name, unit in own.items()}


def _sheet(rows: list[list[Any]]) -> Columns:
    """Columns of a sheet, and their units."""
    first = next((k for k, row in enumerate(rows) if _numeric(row)), None)
    if first is None:
        return {}, {}
    width = min(max(len(row) for row in rows[first:]), _MOST_COLUMNS)
    names, units = _header([_texts(row, width) for row in rows[:first]], width)
    columns: dict[str, FloatArray] = {}
    found: dict[str, str] = {}
    for k in range(width):
        cells = [row[k] if k < len(row) else None for row in rows[first:]]
        seconds = clock_seconds([cell.isoformat() if isinstance(cell, datetime) else cell for cell in cells])
        values = seconds if seconds is not None else np.array([_number(cell) for cell in cells])
        if names[k] or not np.all(np.isnan(values)):
            name = names[k] or str(k + 1)
            name = f"{name} ({k + 1})" if name in columns else name
            columns[name] = values
            if unit := "s" if seconds is not None else units[k]:
                found[name] = unit
    return columns, found


def _header(lines: list[list[str]], width: int) -> tuple[list[str], list[str]]:
    """Names and units of the columns; empty texts where there are none."""
    above = [line for line in lines if any(line)]
    units = [""] * width
    if len(above) > 1 and all(not text or is_unit(text) for text in above[-1]):
        units = above.pop()
    return above[-1] if above else [""] * width, units


def _texts(row: list[Any], width: int) -> list[str]:
    texts = ["" if cell is None else str(cell).strip() for cell in row[:width]]
    return texts + [""] * (width - len(texts))


def _numeric(row: list[Any]) -> bool:
    """Whether most cells that are not empty are numbers or clocks, and one is a number."""
    filled = [cell for cell in row if cell not in (None, "")]
    numbers = sum(not np.isnan(_number(cell)) for cell in filled)
    clocks = sum(isinstance(cell, datetime) for cell in filled)
    return numbers > 0 and 2 * (numbers + clocks) > len(filled)


def _number(cell: Any) -> float:
    return float(cell) if isinstance(cell, int | float) else np.nan


FORMAT = ImportFormat(
    name="Excel",
    versions="workbooks of 2007 and later",
    endings=(".xlsx", ".xlsm"),
    columns="every column; with several sheets `sheet.column`; date and time are seconds since the first row",
    units="the line below the names, if all its cells are units; a clock has s",
    read=excel_columns,
    contained=True,
    package="openpyxl",
    extra="excel",
)
