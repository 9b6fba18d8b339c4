"""TYDEX files (TYDEX-Format, release 1.3): tyre measurements as text."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.formats.delimited_text import file_text
from mofit.data.importers.registry import Columns, ImportFormat
from mofit.errors import InputError

#: columns of a line of **CONSTANTS and **MEASURCHANNELS, from the manual: name, comment, unit, then numbers
_NAME, _UNIT = slice(0, 10), slice(40, 50)
_VALUE = 50


def is_tydex(start: bytes) -> bool:
    """Whether a file that begins like this is TYDEX."""
    return any(line.strip().upper() == b"**HEADER" for line in start.splitlines())


def tydex_columns(path: Path) -> Columns:
    """Measuring channels by their TYDEX name (``SLIPANGL``, ``FYW`` …) and numeric constants, with units.

    A line of ``**CONSTANTS`` or ``**MEASURCHANNELS`` has the name in columns 1 to 10, the unit in 41 to 50 and numbers
    from 51 on; for a channel these are a factor and two offsets. Channels are multiplied by their factor.

    Raises
    ------
    InputError
        If the file has no channels or data, rows of another number of cells, or offsets that are not 0.
    """
    where = f"file '{path.name}'"
    sections = _sections(file_text(path))
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for line in sections.get("**CONSTANTS", []):
        try:
            value = float(line[_VALUE:].split()[0])
        except (ValueError, IndexError):
            continue
        if math.isfinite(value) and line[_NAME].strip():
            columns[line[_NAME].strip()] = np.array([value])
            units[line[_NAME].strip()] = line[_UNIT].strip()
    channels = sections.get("**MEASURCHANNELS", [])
    data = _data(where, sections.get("**MEASURDATA", []), len(channels))
    for k, line in enumerate(channels):
        name = line[_NAME].strip() or str(k + 1)
        name = f"{name} ({k + 1})" if name in columns else name
        columns[name] = _factor(where, name, line) * data[:, k]
        units[name] = line[_UNIT].strip()
    return columns, {name: unit for name, unit in units.items() if unit}


def _sections(text: str) -> dict[str, list[str]]:
    """Lines below every keyword, without comments (``!``) and empty ones."""
    sections: dict[str, list[str]] = {}
    current: list[str] = []
    for line in text.splitlines():
        if line.startswith("**"):
            # the number of rows may follow **MEASURDATA
            current = sections.setdefault((line.upper().split() or [""])[0], [])
        elif line.strip() and not line.startswith("!"):
            current.append(line)
    return sections


def _data(where: str, lines: list[str], count: int) -> FloatArray:
    if not count or not lines:
        missing = "**MEASURDATA" if count else "**MEASURCHANNELS"
        raise InputError.of(where, f"no {missing}", "Give a complete TYDEX file")
    widths = {len(line.split()) for line in lines}
    if widths != {count}:
        what = f"{count} channels, but rows of {', '.join(map(str, sorted(widths)[:5]))} cells"
        raise InputError.of(where, what, "The file is damaged or cut off: copy it again")
    try:
        return np.loadtxt(io.StringIO("\n".join(lines)), dtype=float, ndmin=2, comments=None)
    except ValueError as error:
        raise InputError.of(where, f"a cell is no number ({error})", "Correct the cell or cut the row") from error


def _factor(where: str, name: str, line: str) -> float:
    """Factor of a channel; 1 where the line has none."""
    try:
        factor, *offsets = (float(cell) for cell in line[_VALUE:].split()) if line[_VALUE:].strip() else (1.0,)
    except ValueError as error:
        what = f"'{line[_VALUE:].strip()}' is no factor and offsets"
        raise InputError.of(f"{where}, channel '{name}'", what, "Give numbers from column 51 on") from error
    if any(offsets):
        what = f"has offsets {', '.join(f'{offset:g}' for offset in offsets)}, which are not read"
        raise InputError.of(f"{where}, channel '{name}'", what, "Export physical values, with offsets 0")
    return factor


FORMAT = ImportFormat(
    name="TYDEX",
    versions="1.3; also any text file that begins with `**HEADER`",
    endings=(".tdx", ".tydex"),
    columns="measuring channels by their TYDEX name, times their factor; numeric constants",
    units="of the channel",
    read=tydex_columns,
    recognises=is_tydex,
)
