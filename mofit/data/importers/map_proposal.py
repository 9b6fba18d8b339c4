"""A map proposed from the names and units of a file's columns: a draft for the user to check."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.alike_records import alike_records, record_pattern
from mofit.data.importers.channel_aliases import FAMILIES, TIME, Family, fits, key, name_and_unit, read_unit
from mofit.data.importers.contained import Contained
from mofit.data.importers.registry import known_endings
from mofit.data.importers.table import Table, read_table, source_files
from mofit.data.validation import time_issues, usual_rate
from mofit.errors import InputError, Issue, collected
from mofit.quantities import known_unit
from mofit.runtime.toml import toml_value
from mofit.units import to_si

#: share of its mean by which a column may vary and still be a condition
STEADY = 0.2
#: share of an input's variance that a sine must explain
SINE_SHARE = 0.95


@dataclass(frozen=True)
class Guess:
    """A column taken for a quantity, with a remark on how its unit was found."""

    column: str
    unit: str
    remark: str


def propose_map(sources: Sequence[Path], contained: Contained | None = None) -> str:
    """A map file (TOML) for these files: one test per file.

    Names are compared with `mofit.data.importers.channel_aliases`; a column whose unit does not fit is skipped. Where
    the file has no unit, the size of the values decides. Files in which no input and output are found are left out.
    Comments report both. The ``sources`` are files, and folders of files. Formats that a library parses are read by
    ``contained``, by default a process for this proposal.

    Raises
    ------
    InputError
        If there is no file of a known format, or none in which input and output are found; lists the columns.
    """
    files = source_files([Path(source) for source in sources])
    endings = known_endings()
    chosen = {name: path for name, path in files.items() if {s.lower() for s in path.suffixes} & {*endings}}
    if not chosen:
        raise InputError.of("--guess", "no file of a known format", f"Give files that end in {', '.join(endings)}")
    title = Path(sources[0]).stem.replace("_", " ") if len(sources) == 1 else "My specimen"
    # values that overflow are not used
    lines: list[str] = []
    skipped: list[Issue] = []
    with np.errstate(all="ignore"), nullcontext(contained) if contained else Contained() as contained:
        for name, path in sorted(chosen.items()):
            with collected(skipped):
                lines += _test(name, read_table(path, contained))
    if not lines:
        raise InputError(skipped)
    head = [f"title = {toml_value(title)}", 'source = "measured"', "# a proposal: check every line before you import"]
    notes = [f"# skipped: {_line(issue.where)}: {_line(issue.message)}" for issue in skipped]
    return "\n".join([*head, "", *notes, *lines])


def _line(text: str) -> str:
    """Text that fits in a comment: no control characters."""
    return "".join(sign if sign.isprintable() else " " for sign in text)


def _name(file: Path) -> str:
    """Name of a test: the file's, without the endings of its format, and without points."""
    while file.suffix.lower() in (*known_endings(), ".gz"):
        file = file.with_suffix("")
    return file.name.replace(".", "_")


def _test(file: str, table: Table) -> Iterator[str]:
    """Lines of one test, or of one per record where the file has several alike."""
    alike = alike_records(table)
    table = table.record(alike[0]) if alike else table
    family, channels = _channels(table)
    rows = len(table.column(channels[family.needed[0]].column))
    time = _find(table, "time", TIME, rows)
    driver = channels[family.needed[0]]
    procedure, frequency = _procedure(table, time, driver)
    name = _name(Path(file))
    pattern, groups = record_pattern(alike)
    yield from ("[[tests]]", f"name = {toml_value('_'.join([name, *(f'{{{group}}}' for group in groups)]))}")
    yield f"file = {toml_value(file)}"
    if alike:
        yield f"records = {toml_value(pattern)}  # {len(alike)} records; what follows is of the first"
    yield f'procedure = "{procedure}"'
    if frequency:
        yield f'frequency = "{frequency:.4g} Hz"  # from the input; amplitude = "…" may be added'
    if time is None:
        yield 'time = { column = "?", unit = "s" }  # no time column found: name it, or give sample_rate = "… Hz"'
    else:
        yield f"time = {_entry(time)}"
        yield from _resample(table, time)
        if others := _other_times(table, time):
            yield f"# other times of as many samples: {', '.join(others)}; the channels must share the one above"
    yield from ("", "[tests.channels]", *(f"{name} = {_entry(found)}" for name, found in channels.items()))
    conditions = {
        name: found
        for name, words in family.conditions.items()
        if (found := _find(table, name, words.split(), None, {g.column for g in channels.values()}))
    }
    if conditions:
        yield from ("", "[tests.conditions]", *(_condition(table, name, found) for name, found in conditions.items()))
    used = {g.column for g in (*channels.values(), *conditions.values(), *([time] if time else []))}
    if unused := [name for name in table.columns if name not in used]:
        yield f"# not used: {', '.join(toml_value(name) for name in unused[:40])}"
    yield ""


def _other_times(table: Table, time: Guess) -> list[str]:
    """Time columns of the same length that hold other times: channels of an MDF file may follow any of them."""
    own = table.column(time.column)
    return [
        toml_value(name)
        for name, values in table.columns.items()
        if key(name) in TIME and len(values) == len(own) and not np.array_equal(values, own, equal_nan=True)
    ]


def _channels(table: Table) -> tuple[Family, dict[str, Guess]]:
    for family in FAMILIES:
        found: dict[str, Guess] = {}
        rows: int | None = None
        for name, words in family.spellings.items():
            guess = _find(table, name, words.split(), rows, {g.column for g in found.values()})
            if guess:
                found[name] = guess
                rows = len(table.column(guess.column))
        if set(family.needed) <= set(found):
            return family, found
    columns = ", ".join(f"{name} [{table.units.get(name, '?')}]" for name in list(table.columns)[:40])
    hint = "Write the map by hand (docs/campaigns.md), or name the columns like 'slip_angle' and 'lateral_force'"
    raise InputError([Issue(f"file '{table.name}'", f"no input and output found among its columns: {columns}", hint)])


def _find(
    table: Table, quantity: str, words: Sequence[str], rows: int | None, taken: set[str] | frozenset[str] = frozenset()
) -> Guess | None:
    """The column spelt the most usual way, of this length, whose unit fits; constants are no channels."""
    wanted = {quantity.replace("_", ""): -1, **{word: rank for rank, word in reversed(list(enumerate(words)))}}
    ranked = []
    for order, (column, values) in enumerate(table.columns.items()):
        name, unit = name_and_unit(column, quantity)
        if given := table.units.get(column):
            unit = read_unit(given, quantity) or given
        rank = min((wanted[k] for k in (key(name), key(column)) if k in wanted), default=None)
        long_enough = len(values) == rows if rows else len(values) > 1 or quantity in _SIZES
        if rank is not None and long_enough and column not in taken and fits(quantity, unit):
            ranked.append((rank, order, column, unit))
    if not ranked:
        return None
    _, _, column, unit = min(ranked)
    if unit:
        return Guess(column, unit, "")
    return Guess(column, _likely(quantity, table.column(column)), "unit guessed from the values: check it")


#: unit by size: the first whose limit the values stay below
_SIZES: Mapping[str, tuple[tuple[float, str], ...]] = {
    "slip_angle": ((0.55, "rad"), (np.inf, "deg")),
    "camber_angle": ((0.3, "rad"), (np.inf, "deg")),
    "angle": ((7.0, "rad"), (np.inf, "deg")),
    "slip_ratio": ((1.5, "1"), (np.inf, "%")),
    "lateral_displacement": ((0.3, "m"), (np.inf, "mm")),
    "displacement": ((0.5, "m"), (np.inf, "mm")),
    "longitudinal_displacement": ((0.3, "m"), (np.inf, "mm")),
    "longitudinal_force": ((30.0, "kN"), (np.inf, "N")),
    "lateral_force": ((30.0, "kN"), (np.inf, "N")),
    "vertical_force": ((30.0, "kN"), (np.inf, "N")),
    "longitudinal_velocity": ((25.0, "m/s"), (np.inf, "km/h")),
    "inflation_pressure": ((10.0, "bar"), (1500.0, "kPa"), (np.inf, "Pa")),
    "dynamic_rolling_radius": ((3.0, "m"), (np.inf, "mm")),
    "temperature": ((200.0, "degC"), (np.inf, "K")),
    "current": ((np.inf, "A"),),
    "time": ((np.inf, "s"),),
}


def _likely(quantity: str, values: FloatArray) -> str:
    size = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    return next((unit for limit, unit in _SIZES.get(quantity, ()) if size < limit), known_unit(quantity) or "1")


def _procedure(table: Table, time: Guess | None, driver: Guess) -> tuple[str, float | None]:
    """``sine`` and its frequency where the input is one, else ``free``."""
    from mofit.data.signals.periodicity import sine_period  # imports scipy, which an import with a map does not need

    if time is None:
        return "free", None
    stamps, values = to_si(table.column(time.column), time.unit, "s"), table.column(driver.column)
    if not np.all(np.isfinite(values)) or time_issues("", stamps) or not 0 < np.var(values) < np.inf:
        return "free", None
    period = sine_period(stamps, values)
    if period is None or period > np.ptp(stamps):
        return "free", None
    phase = 2 * np.pi * stamps / period
    design = np.column_stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return ("sine", 1 / period) if np.var(left) < (1 - SINE_SHARE) * np.var(values) else ("free", None)


def _resample(table: Table, time: Guess) -> Iterator[str]:
    """The key that brings uneven stamps to one rate, where it can."""
    stamps = to_si(table.column(time.column), time.unit, "s")
    found = time_issues("", stamps)
    if found and "resample" in found[0].hint and 0 < (rate := usual_rate(stamps)) < np.inf:
        yield f'resample = "{rate:.4g} Hz"  # the time {_line(found[0].message)}'


def _condition(table: Table, name: str, found: Guess) -> str:
    values = table.column(found.column)
    mean, spread = float(np.mean(values)), float(np.ptp(values))
    line = f"{name} = {_entry(found)}"
    if len(values) > 1 and not spread <= STEADY * abs(mean):
        return f"# {line}  varies from {np.min(values):.4g} to {np.max(values):.4g}: not a condition of the whole test"
    return line


def _entry(found: Guess) -> str:
    entry = f"{{ column = {toml_value(found.column)}, unit = {toml_value(found.unit)} }}"
    return f"{entry}  # {found.remark}" if found.remark else entry
