"""From files and a map to a campaign."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cache, partial
from pathlib import Path

import numpy as np

from mofit.campaign import Array, Campaign, Measurement, Procedure
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.labels import CHANNELS, known_unit
from mofit.readers.contained import Contained
from mofit.readers.gaps import longest_whole
from mofit.readers.map_file import ColumnMap, TestMap, quantity, read_map
from mofit.readers.table import Table, read_table
from mofit.units import UnitError, si_unit, to_si
from mofit.validity import channel_faults, finite_faults, role_faults, time_faults, whole_period_faults

_UNITS = {"frequency": "Hz", "start_time": "s", "transient": "s", "sample_rate": "Hz"}


def import_files(sources: Sequence[Path], map_path: Path, contained: Contained | None = None) -> Campaign:
    """Read the tests that a map names into one campaign, in SI units.

    Parameters
    ----------
    sources
        Files, and folders of files, that the map's file names are looked up in; without any, the
        folder of the map.
    map_path
        The map file.
    contained
        Process that reads MAT and MDF files; by default one for this import.

    Raises
    ------
    InputError
        With the faults of the map, of the files and of every test together.
    """
    map_path = Path(map_path)
    plan = read_map(map_path)
    files = source_files([Path(source) for source in sources] or [map_path.parent])
    faults: list[Fault] = []
    conditions, units = _conditions("root", plan.conditions, faults)
    measurements = []
    # what overflows becomes infinite, and is counted as such
    with np.errstate(all="ignore"), nullcontext(contained) if contained else Contained() as contained:
        load = cache(partial(read_table, contained=contained))
        for test in _expand(plan.tests, files, faults):
            try:
                measurement, own_units = _measurement(test, load(files[test.file or ""]), {**conditions})
                units |= own_units
                measurements.append(measurement)
            except InputError as error:
                faults += error.faults
    raise_errors(dict.fromkeys(faults))
    return Campaign(plan.title, plan.source, conditions, tuple(measurements), dict(plan.attributes), units)


def source_files(sources: Sequence[Path]) -> dict[str, Path]:
    """All files on offer, by name.

    Raises
    ------
    InputError
        With every source that is not there, or whose name is given twice.
    """
    files: dict[str, Path] = {}
    faults = []
    for source in sources:
        if source.is_dir():
            found = sorted(path for path in source.iterdir() if path.is_file())
        elif source.is_file():
            found = [source]
        else:
            faults.append(Fault(f"file '{source}'", "there is no such file or folder", "Check the path"))
            continue
        for path in found:
            if path.name in files and not path.samefile(files[path.name]):
                faults.append(Fault(f"file '{path.name}'", "is given twice", "Name only one of them"))
            files[path.name] = path
    raise_errors(faults)
    return files


def _expand(tests: Sequence[TestMap], files: dict[str, Path], faults: list[Fault]) -> list[TestMap]:
    """One entry per test: patterns are matched against the file names, by frequency."""
    expanded = []
    for test in tests:
        where = f"test '{test.name}'"
        if test.pattern is None:
            if test.file in files:
                expanded.append(test)
            else:
                cure = did_you_mean(str(test.file), files)
                faults.append(Fault(where, f"there is no file '{test.file}'", cure))
            continue
        try:
            matches = [(name, match) for name in files if (match := re.fullmatch(test.pattern, name))]
            filled = [_fill(test, name, match) for name, match in matches]
        except (re.error, KeyError, IndexError) as error:
            cure = "Write a regular expression, and fill in only groups that it names"
            faults.append(Fault(where, f"pattern '{test.pattern}': {error}", cure))
            continue
        if not filled:
            cure = "Give the folder of the files before --map, or mend the pattern"
            faults.append(Fault(where, f"no file matches '{test.pattern}'", cure))
        expanded += sorted(filled, key=lambda entry: quantity(where, entry.frequency or 0.0, "Hz")[0])
    return expanded


def _fill(test: TestMap, file: str, match: re.Match[str]) -> TestMap:
    groups = {key: (text or "").replace(test.decimal, ".") for key, text in match.groupdict().items()}
    texts = {key: value for key, value in test.model_dump().items() if isinstance(value, str) and key != "pattern"}
    filled = {key: value.format(**groups) for key, value in texts.items()}
    own = {key: v.format(**groups) if isinstance(v, str) else v for key, v in test.conditions.items()}
    return test.model_copy(update={**filled, "conditions": own, "file": file, "pattern": None})


def _measurement(test: TestMap, table: Table, shared: dict[str, float]) -> tuple[Measurement, dict[str, str]]:
    where = f"test '{test.name}'"
    faults: list[Fault] = []
    columns = {name: value for name, value in test.conditions.items() if isinstance(value, ColumnMap)}
    fixed = {name: value for name, value in test.conditions.items() if not isinstance(value, ColumnMap)}
    own, condition_units = _conditions(where, fixed, faults)
    sensed: dict[str, Array] = {}
    for name, column in columns.items():
        try:
            place = f"condition '{name}'"
            sensed[name], condition_units[name] = _column(where, place, column, known_unit(name), table, test.rows)
        except InputError as error:
            faults += error.faults
    channels: dict[str, dict[str, Array]] = {"input": {}, "output": {}}
    units = {}
    for name, column in test.channels.items():
        role = column.role or (CHANNELS[name].role if name in CHANNELS else None)
        if role is None:
            cure = f"Add role = 'input' or 'output'. {did_you_mean(name, CHANNELS)}"
            faults.append(Fault(f"{where}, channel '{name}'", "has no role", cure))
            continue
        try:
            place = f"channel '{name}'"
            channels[role][name], units[name] = _column(where, place, column, known_unit(name), table, test.rows)
        except InputError as error:
            faults += error.faults
    driver = next((units[name] for name in channels["input"]), None)
    numbers: dict[str, float | None] = {}
    for key in ("frequency", "amplitude", "start_time", "transient", "sample_rate"):
        value = getattr(test, key)
        try:
            numbers[key] = None if value is None else quantity(f"{where}, {key}", value, _UNITS.get(key, driver))[0]
        except InputError as error:
            faults += error.faults
    raise_errors(faults)
    rate = numbers.pop("sample_rate")
    if test.time is not None:
        time, _ = _column(where, "channel 'time'", test.time, "s", table, test.rows)
    else:
        length = max((len(v) for group in channels.values() for v in group.values()), default=0)
        time = np.arange(length) / float(rate or 1.0)
    gaps = 0
    if test.gaps == "longest":
        time, gaps = _cut(time, [channels["input"], channels["output"], sensed], numbers)
    time = time - time[0] if time.size else time
    faults = _faults(where, test, time, channels, numbers["frequency"])
    for name, values in sensed.items():
        faults += finite_faults(f"{where}, condition '{name}'", values)
        own[name] = float(np.mean(values)) if values.size else np.nan
    if not faults:
        faults = [f for name in sensed for f in finite_faults(f"{where}, mean of '{name}'", np.atleast_1d(own[name]))]
    raise_errors(faults)
    procedure = Procedure(
        test.name, test.procedure, time, channels["input"], {**shared, **own}, **numbers, hold=test.hold
    )
    return Measurement(procedure, channels["output"], units, gaps), condition_units


def _cut(time: Array, groups: Sequence[dict[str, Array]], numbers: dict[str, float | None]) -> tuple[Array, int]:
    """The time of the longest stretch without gaps, to which signals and numbers are cut in place; and the gaps."""
    recorded = [values for group in groups for values in group.values() if len(values) == len(time)]
    kept, gaps = longest_whole(time, recorded)
    for group in groups:
        group.update({name: values[kept] for name, values in group.items() if len(values) == len(time)})
    if kept.start < kept.stop:
        cut = float(time[kept.start] - time[np.isfinite(time)][0])
        if numbers["start_time"] is not None:
            numbers["start_time"] += cut
        if numbers["transient"] is not None:
            numbers["transient"] = max(numbers["transient"] - cut, 0.0)
    return time[kept], gaps


def _faults(
    where: str, test: TestMap, time: Array, channels: dict[str, dict[str, Array]], frequency: float | None
) -> list[Fault]:
    faults = time_faults(where, time)
    for group in channels.values():
        for name, values in group.items():
            if len(values) != len(time):
                what = f"{len(values)} samples, but {len(time)} time stamps"
                faults.append(Fault(f"{where}, channel '{name}'", what, "Take columns of one table"))
    if not faults:
        faults += whole_period_faults(where, test.procedure, time, frequency)
    faults += role_faults(where, channels["input"], channels["output"])
    return faults + channel_faults(where, test.procedure, channels["input"], channels["output"])


def _column(
    test: str, what_for: str, column: ColumnMap, unit: str | None, table: Table, rows: tuple[int, int] | None
) -> tuple[Array, str]:
    """A column in ``unit``, or else in the SI unit of its own, and that unit."""
    where = f"{test}, {what_for}"
    values = table.column(column.column)
    own = column.unit if column.unit is not None else table.units.get(table.name_of(column.column))
    if own is None:
        what = f"column '{column.column}' has no unit"
        raise InputError.of(where, what, f"Add unit = '{unit or '…'}', or the unit that the file's column is in")
    if rows is not None and values.size > 1:
        if rows[1] > len(values):
            what = f"rows {rows[0]} to {rows[1]} of file '{table.name}', which has {len(values)}"
            raise InputError.of(test, what, "Correct the rows")
        values = values[rows[0] - 1 : rows[1]]
    scale = column.scale
    if isinstance(scale, str):
        constant = table.column(scale)
        if constant.size != 1:
            what = f"scale '{scale}' has {constant.size} values"
            raise InputError.of(where, what, "Name a constant, or give a number")
        scale = float(constant[0])
    try:
        target = unit or si_unit(own)
        return to_si(scale * values + column.offset, own, target), target
    except UnitError as error:
        cure = f"Give the unit of the file's column{f'; it must convert to {unit!r}' if unit else ''}"
        raise InputError.of(where, str(error), cure) from error


def _conditions(
    where: str, given: Mapping[str, float | str], faults: list[Fault]
) -> tuple[dict[str, float], dict[str, str]]:
    conditions, units = {}, {}
    for name, value in given.items():
        try:
            conditions[name], units[name] = quantity(f"{where}, condition '{name}'", value, known_unit(name))
        except InputError as error:
            faults += error.faults
    return conditions, units
