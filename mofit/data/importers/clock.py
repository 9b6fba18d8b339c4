"""Cells that hold a clock as seconds: ISO 8601, ``04.03.2021 10:11:12,5``, ``3/4/2021 10:11:12 AM``, ``10:11:12.5``."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray

#: date of the years 1700 to 2199, which fit in 64 bits of ns; time to the minute or finer; zone
_ISO = re.compile(r"(1[7-9]|2[01])\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d{1,9})?)?\s?(Z|[+-]\d\d(:?\d\d)?)?")
#: a date as loggers write it: day, month and year, or the year first
_DATE = (
    r"(?:(?P<a>\d{1,2})(?P<sign>[./-])(?P<b>\d{1,2})[./-](?P<y>\d{4}|\d\d)"
    r"|(?P<Y>\d{4})[./](?P<m>\d{1,2})[./](?P<d>\d{1,2}))"
)
_TIME = r"(?P<h>\d{1,2}):(?P<min>\d\d)(?::(?P<s>\d\d(?:[.,:]\d{1,9})?))?\s?(?P<half>[AaPp][Mm])?"
_LOGGER = re.compile(rf"(?:{_DATE}[T ,]\s?)?{_TIME}")
_DATE_ALONE = re.compile(rf"{_DATE}|\d{{4}}-\d\d-\d\d")
_BLANK = re.compile(r"(\d{4}-\d\d-\d\d|\d{1,2}[./-]\d{1,2}[./-]\d{2,4}|\d{4}[./]\d{1,2}[./]\d{1,2}) +(\d{1,2}:\d\d)")
_BLANK_HALF = re.compile(r"(:\d\d(?:[.,]\d+)?) ([AaPp][Mm])\b")
_DAY = 86400.0


def is_clock(cell: str) -> bool:
    """Whether a cell holds a time of the day, with its date or without."""
    cell = cell.strip()
    return _ISO.fullmatch(cell) is not None or _LOGGER.fullmatch(cell) is not None


def is_date(cell: str) -> bool:
    """Whether a cell holds a date alone."""
    return _DATE_ALONE.fullmatch(cell.strip()) is not None


def joined(line: str) -> str:
    """A line in which no blank stands inside a clock, so that blanks may separate its cells."""
    return _BLANK_HALF.sub(r"\1\2", _BLANK.sub(r"\1T\2", line))


def clock_seconds(cells: Sequence[object]) -> FloatArray | None:
    """Seconds since the first clock, shape (n,); None if the first cell that is not empty is no clock.

    Cells without a zone are in UTC. A cell that is no clock is NaN. Of ``3/4/2021`` the first number is the month
    unless one of the cells has a first number above 12; of ``3.4.2021`` and ``3-4-2021`` it is the day. A clock without
    a date goes on after midnight.
    """
    texts = ["" if cell is None else str(cell).strip() for cell in cells]
    first = next((text for text in texts if text), "")
    if not is_clock(first):
        return None
    return _iso_seconds(texts) if _ISO.fullmatch(first) else _logger_seconds(texts)


def _iso_seconds(texts: Sequence[str]) -> FloatArray | None:
    import pandas as pd  # heavy, and few tables have a clock

    texts = [text.replace(",", ".").replace(" Z", "Z") if _ISO.fullmatch(text) else "" for text in texts]
    stamps = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True, errors="coerce").to_numpy("datetime64[ns]")
    first = stamps[~np.isnat(stamps)][:1]
    if not first.size:
        return None
    # integers of ns: no digit is lost, however long ago the epoch was
    seconds = (stamps - first[0]).astype("timedelta64[ns]").astype(np.int64) / 1e9
    return np.where(np.isnat(stamps), np.nan, seconds)


def _logger_seconds(texts: Sequence[str]) -> FloatArray | None:
    matches = [_LOGGER.fullmatch(text) for text in texts]
    day_first = any(m and m["a"] and (m["sign"] != "/" or int(m["a"]) > 12) for m in matches)
    of_day = np.array([_second_of_day(m) if m else np.nan for m in matches])
    days = np.array([_day(m, day_first) if m else np.nan for m in matches])
    known = np.flatnonzero(np.isfinite(of_day) & np.isfinite(days))
    if not known.size:
        return None
    if not any(m and (m["a"] or m["Y"]) for m in matches):
        days[known] = np.cumsum(np.diff(of_day[known], prepend=of_day[known[0]]) < -_DAY / 2)
    # days first: the seconds since the epoch would cost digits
    return np.asarray((days - days[known[0]]) * _DAY + (of_day - of_day[known[0]]))


def _second_of_day(match: re.Match[str]) -> float:
    hour = int(match["h"])
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"].lower() == "pm")
    second = (match["s"] or "0").replace(",", ".").replace(":", ".")
    return 3600.0 * hour + 60.0 * int(match["min"]) + float(second)


def _day(match: re.Match[str], day_first: bool) -> float:
    """Days since 1970; 0 without a date, NaN of a day that the calendar does not have."""
    if match["Y"]:
        year, month, day = int(match["Y"]), int(match["m"]), int(match["d"])
    elif match["a"]:
        first, second = int(match["a"]), int(match["b"])
        day, month = (first, second) if day_first else (second, first)
        year = int(match["y"]) + (2000 if len(match["y"]) == 2 else 0)
    else:
        return 0.0
    try:
        return float(np.datetime64(f"{year:04d}-{month:02d}-{day:02d}", "D").astype(np.int64))
    except ValueError:
        return np.nan
