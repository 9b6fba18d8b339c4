"""MDF files (ASAM MDF 4, also 3) through asammdf."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat


def mdf_columns(path: Path) -> Columns:
    """Numeric channels by name, with units; the time of every channel group is a column too.

    A name that several groups use is preceded by its group, counted from 1: ``g1.time``, ``g2.time``. Samples that
    the file marks as invalid are NaN. Values are physical: conversions of the file are applied; text is passed over.

    Raises
    ------
    InputError
        If a group claims to be larger than the file can hold.
    Exception
        Whatever asammdf raises on a damaged file.
    """
    from asammdf import MDF

    found: list[tuple[int, str, FloatArray, str]] = []
    with MDF(path) as file:
        groups: Any = file.groups
        for index, group in enumerate(groups):
            record = group.channel_group
            size = record.cycles_nr * max(int(getattr(record, "samples_byte_nr", 0)), 1)
            LIMITS.check(path, size + record.cycles_nr)
            for number, channel in enumerate(group.channels):
                # else asammdf leaves out the samples that are invalid, and the time axis would no longer fit
                signal = file.get(group=index, index=number, ignore_invalidation_bits=True)
                values = np.asarray(signal.samples)
                if values.ndim != 1 or not values.size or values.dtype.kind not in "fiub":
                    continue
                values = values.astype(float)
                if (invalid := signal.invalidation_bits) is not None:
                    values[np.asarray(invalid, dtype=bool)[: values.size]] = np.nan
                found.append((index, str(channel.name), values, str(signal.unit or "")))
    shared = {name for name, count in Counter(name for _, name, _, _ in found).items() if count > 1}
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for index, name, values, unit in found:
        full = f"g{index + 1}.{name}" if name in shared else name
        if full not in columns:
            columns[full] = values
            if unit:
                units[full] = unit
    return columns, units


FORMAT = ImportFormat(
    name="MDF",
    versions="4, also 3 (ASAM)",
    endings=(".mf4", ".mdf"),
    columns="numeric channels, physical values, and the time of every channel group; a name that several groups use "
    "is preceded by its group: `g1.time`, `g2.time`",
    units="of the channel",
    read=mdf_columns,
    contained=True,
    package="asammdf",
    extra="mdf",
)
