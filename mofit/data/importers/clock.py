"""Cells that hold a clock, ``2021-03-04 10:11:12.5`` or ISO 8601 with ``T``, ``Z`` or an offset, as seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray

#: date of the years 1700 to 2199, which fit in 64 bits of ns; time to the minute or finer; zone
_CLOCK = re.compile(r"(1[7-9]|2[01])\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d{1,9})?)?\s?(Z|[+-]\d\d(:?\d\d)?)?")
_BLANK = re.compile(r"(\d{4}-\d\d-\d\d) (\d\d:\d\d)")


def is_clock(cell: str) -> bool:
    """Whether a cell holds date and time."""
    return _CLOCK.fullmatch(cell.strip()) is not None


def joined(line: str) -> str:
    """A line in which no blank stands between date and time, so that blanks may separate its cells."""
    return _BLANK.sub(r"\1T\2", line)


def clock_seconds(cells: Sequence[object]) -> FloatArray | None:
    """Seconds since the first clock, shape (n,); None if the first cell that is not empty is no clock.

    Cells without a zone are in UTC. A cell that is no clock is NaN.
    """
    texts = ["" if cell is None else str(cell).strip() for cell in cells]
    if not is_clock(next((text for text in texts if text), "")):
        return None
    import pandas as pd  # heavy, and few tables have a clock

    texts = [text.replace(",", ".").replace(" Z", "Z") if is_clock(text) else "" for text in texts]
    stamps = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True, errors="coerce").to_numpy("datetime64[ns]")
    first = stamps[~np.isnat(stamps)][:1]
    if not first.size:
        return None
    # integers of ns: no digit is lost, however long ago the epoch was
    seconds = (stamps - first[0]).astype("timedelta64[ns]").astype(np.int64) / 1e9
    return np.where(np.isnat(stamps), np.nan, seconds)
