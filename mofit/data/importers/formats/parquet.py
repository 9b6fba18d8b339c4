"""Parquet files through pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.clock import clock_seconds
from mofit.data.importers.registry import Columns, ImportFormat, ImportLimits

#: a constant column takes a few bytes however long it is, so that only the size of the unpacked table counts
_LIMITS = ImportLimits(expansion=1 << 30)


def parquet_columns(path: Path) -> Columns:
    """Numeric columns by name, and columns of date and time in seconds since their first row.

    A missing value is NaN. Text, lists and structs are passed over.

    Raises
    ------
    Exception
        Whatever pyarrow raises on a damaged file.
    InputError
        If the file claims to hold a table beyond the limits.
    """
    import pyarrow.parquet as pq

    columns: dict[str, FloatArray] = {}
    clocks: dict[str, str] = {}
    with pq.ParquetFile(path) as file:
        _LIMITS.check(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
        table = file.read()
    for name, column in zip(table.column_names, table.columns, strict=True):
        numbers, seconds = _numbers(column), _seconds(column)
        if numbers is not None and numbers.size:
            columns[name] = numbers
        elif seconds is not None:
            columns[name], clocks[name] = seconds, "s"
    return columns, clocks


def _numbers(column: Any) -> FloatArray | None:
    from pyarrow import float64, types

    if types.is_integer(column.type) or types.is_floating(column.type) or types.is_boolean(column.type):
        return np.asarray(column.cast(float64(), safe=False).to_numpy(), dtype=float)
    return None


def _seconds(column: Any) -> FloatArray | None:
    """Seconds since the first stamp, of a column of stamps or of text with date and time."""
    from pyarrow import types

    if types.is_string(column.type) or types.is_large_string(column.type):
        return clock_seconds(column.to_pylist())
    if not types.is_timestamp(column.type):
        return None
    stamps = column.to_numpy().astype("datetime64[ns]")
    first = stamps[~np.isnat(stamps)][:1]
    return np.asarray((stamps - first) / np.timedelta64(1, "ns") / 1e9, dtype=float) if first.size else None


FORMAT = ImportFormat(
    name="Parquet",
    versions="",
    endings=(".parquet",),
    columns="numeric columns; date and time are seconds since the first row",
    units="none; a clock has s",
    read=parquet_columns,
    contained=True,
    package="pyarrow",
    extra="parquet",
)
