"""JSON files: matrices by name, rows, or records within records."""

from __future__ import annotations

import json
from pathlib import Path

from mofit.data.importers.formats.delimited_text import file_text
from mofit.data.importers.nested import flat_columns
from mofit.data.importers.registry import Columns, ImportFormat


def json_columns(path: Path) -> Columns:
    """Columns of a JSON file, gzip or not; see `mofit.data.importers.nested.flat_columns`.

    Raises
    ------
    Exception
        Whatever the parser raises on a damaged file.
    InputError
        If the gzip file is damaged, or the text is longer than the limits allow.
    """
    return flat_columns(json.loads(file_text(path)))


FORMAT = ImportFormat(
    name="JSON",
    versions="columns by name, a list of rows, `columns` and `data`; nested or not",
    endings=(".json",),
    columns="arrays of numbers or of date and time; `record.field`, elements of a list counted from 1: `runs.2.force`",
    units="none; a clock has s",
    read=json_columns,
    contained=True,  # deeply nested text raises RecursionError, and numbers take many times the memory of their text
)
