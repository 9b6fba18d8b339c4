"""Records of one file that hold the same columns, and the pattern that a map names them with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from mofit._typing import FloatArray
from mofit.data.importers.table import Table


def alike_records(table: Table) -> list[str]:
    """The largest group of records with the same columns, two at least, and of equal depth; empty if there is none."""
    groups: dict[tuple[int, tuple[str, ...]], list[str]] = {}
    inner: dict[str, list[str]] = {}
    for column in table.columns:
        record, _, name = column.rpartition(".")
        inner.setdefault(record, []).append(name)
    for record, names in inner.items():
        if record and len(names) > 1:
            groups.setdefault((record.count("."), tuple(names)), []).append(record)
    largest = max(groups.values(), key=len, default=[])
    return largest if len(largest) > 1 else []


def records_alone(table: Table, records: Sequence[str]) -> list[Table]:
    """The table of each record: its own columns, and those that belong to none of the records."""
    own: dict[str, dict[str, FloatArray]] = {record: {} for record in records}
    shared: dict[str, FloatArray] = {}
    for column, values in table.columns.items():
        own.get(column.rpartition(".")[0], shared)[column] = values
    return [replace(table, columns={**own[record], **shared}).record(record) for record in records]


def record_pattern(records: Sequence[str]) -> tuple[str, list[str]]:
    """A regular expression that matches all records, which are of equal depth, and the names of its groups.

    Parts that differ become groups ``r1``, ``r2`` and so on.
    """
    parts: list[str] = []
    groups: list[str] = []
    for alternatives in zip(*(record.split(".") for record in records), strict=True):
        if len(set(alternatives)) == 1:
            parts.append(re.escape(alternatives[0]))
        else:
            groups.append(f"r{len(groups) + 1}")
            parts.append(f"(?P<{groups[-1]}>[^.]+)")
    return r"\.".join(parts), groups
