"""Nested values (structs, cells, objects, lists) as columns with names such as ``runs.2.force``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.clock import clock_seconds

#: levels of nesting, beyond which a file is no measurement
_DEEPEST = 12
#: columns of a matrix, beyond which it is rather an image
_WIDEST = 1000


def flat_columns(value: Any) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """Columns of a nested value by name, shape (n,) each, and the unit s of those that were a clock.

    - A field of a mapping is called by its name, an element of a list by its number from 1; points join them.
    - A list of numbers is a column; one of date and time is one in s; a number is a column of one element.
    - A matrix is a column per number from 1; samples run along its longer side, or else down.
    - A list of mappings from names to single values is a table, row by row; ``{"columns": […], "data": [[…]]}`` too.

    Text, empty lists, complex numbers and arrays of more dimensions are passed over. A missing value is NaN.
    """
    columns: dict[str, FloatArray] = {}
    clocks: dict[str, str] = {}
    _collect("", value, columns, clocks, 0)
    return columns, clocks


def _collect(name: str, value: Any, columns: dict[str, FloatArray], clocks: dict[str, str], depth: int) -> None:
    if depth > _DEEPEST:
        return
    if isinstance(value, Mapping):
        for field, inner in _fields(value).items():
            _collect(_join(name, str(field)), inner, columns, clocks, depth + 1)
        return
    array = _numbers(value)
    if array is not None:
        if array.ndim <= 1 and array.size:
            columns[name or "1"] = np.atleast_1d(array)
        elif array.ndim == 2 and 0 < min(array.shape) <= _WIDEST:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            columns |= {_join(name, str(k)): column for k, column in enumerate(tall.T, 1)}
    elif isinstance(value, Sequence) and not isinstance(value, str):
        if (table := _rows(value)) is not None:
            _collect(name, table, columns, clocks, depth + 1)
        elif (seconds := _seconds(value)) is not None:
            columns[name or "1"] = seconds
            clocks[name or "1"] = "s"
        else:
            for number, inner in enumerate(value, 1):
                _collect(_join(name, str(number)), inner, columns, clocks, depth + 1)


def _fields(value: Mapping[Any, Any]) -> Mapping[Any, Any]:
    """Fields of a mapping; those of ``{"columns": names, "data": rows}`` are its columns."""
    names, data = value.get("columns"), value.get("data")
    if not (isinstance(names, list) and isinstance(data, list)):
        return value
    if not all(isinstance(row, list) and len(row) == len(names) for row in data):
        return value
    return {str(name): list(cells) for name, cells in zip(names, zip(*data, strict=True), strict=False)}


def _rows(value: Sequence[Any]) -> Mapping[str, list[Any]] | None:
    """Columns of a list of mappings to single values; a value that a row has not is None."""
    if not value or not all(isinstance(row, Mapping) for row in value):
        return None
    if any(isinstance(cell, Mapping | list | np.ndarray) for row in value for cell in row.values()):
        return None
    names = dict.fromkeys(name for row in value for name in row)
    return {name: [row.get(name) for row in value] for name in names}


def _numbers(value: Any) -> FloatArray | None:
    """An array of numbers; None for text and for what is no array."""
    if isinstance(value, np.ndarray):
        return value.astype(float) if value.dtype.kind in "fiub" else None
    if value is None or isinstance(value, str):
        return None
    if isinstance(value, Sequence) and any(isinstance(item, str) for item in value):
        return None  # "1" is no number
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None


def _seconds(value: Sequence[Any]) -> FloatArray | None:
    return clock_seconds(value) if all(item is None or isinstance(item, str) for item in value) else None


def _join(name: str, field: str) -> str:
    return f"{name}.{field}" if name else field
