"""From files and a map to a campaign."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cache, partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign, Experiment, Measurement
from mofit.data.importers.contained import Contained
from mofit.data.importers.import_map import ColumnMap, TestMap, read_map
from mofit.data.importers.table import Table, read_table, source_files
from mofit.data.names import channel_name_issues, name_issues, shown, title_issues
from mofit.data.validation import experiment_issues, finite_issues, longest_stretch
from mofit.errors import InputError, Issue, collected, did_you_mean, raise_errors
from mofit.quantities import CHANNELS, known_unit
from mofit.units import Quantity, UnitError, parse_quantity, si_unit, to_si

#: SI unit of a test's numbers; that of the amplitude is the unit of the first input
_UNITS = {"frequency": "Hz", "amplitude": None, "start_time": "s", "transient": "s", "sample_rate": "Hz"}


def import_files(sources: Sequence[Path], map_path: Path, contained: Contained | None = None) -> Campaign:
    """Read the tests that a map names into one campaign, in SI units.

    The map's file names are looked up in the ``sources``, files and folders; without any, in the folder of the map.
    Formats that a library parses are read by ``contained``, by default a process for this import.

    Raises
    ------
    InputError
        With the issues of the map, of the files and of every test together.
    """
    map_path = Path(map_path)
    plan = read_map(map_path)
    files = source_files([Path(source) for source in sources] or [map_path.parent])
    issues = title_issues("title", plan.title) + name_issues("attributes", "attribute", plan.attributes)
    conditions, units = _conditions("root", plan.conditions, issues)
    measurements = []
    # what overflows becomes infinite, and is counted as such
    with np.errstate(all="ignore"), nullcontext(contained) if contained else Contained() as contained:
        load = cache(partial(read_table, contained=contained))
        for test in _expand(plan.tests, files, issues):
            with collected(issues):
                measurement, own_units = _measurement(test, load(files[test.file or ""]), conditions)
                units |= own_units
                measurements.append(measurement)
    raise_errors(dict.fromkeys(issues))
    return Campaign(plan.title, plan.source, conditions, tuple(measurements), dict(plan.attributes), units)


def _expand(tests: Sequence[TestMap], files: Mapping[str, Path], issues: list[Issue]) -> list[TestMap]:
    """One entry per test: patterns are matched against the file names, ordered by frequency."""
    expanded = []
    for test in tests:
        where = f"test '{test.name}'"
        if test.pattern is None:
            if test.file in files:
                expanded.append(test)
            else:
                issues.append(Issue(where, f"there is no file '{test.file}'", did_you_mean(str(test.file), files)))
            continue
        try:
            matches = [(name, match) for name in files if (match := re.fullmatch(test.pattern, name))]
            filled = [_fill(test, name, match) for name, match in matches]
        except (re.error, KeyError, IndexError) as error:
            hint = "Write a regular expression, and fill in only groups that it names"
            issues.append(Issue(where, f"pattern '{test.pattern}': {error}", hint))
            continue
        if not filled:
            hint = "Give the folder of the files before --map, or correct the pattern"
            issues.append(Issue(where, f"no file matches '{test.pattern}'", hint))
        expanded += sorted(filled, key=lambda entry: parse_quantity(where, entry.frequency or 0.0, "Hz")[0])
    return expanded


def _fill(test: TestMap, file: str, match: re.Match[str]) -> TestMap:
    groups = {key: (text or "").replace(test.decimal, ".") for key, text in match.groupdict().items()}
    texts = {key: value for key, value in test.model_dump().items() if isinstance(value, str) and key != "pattern"}
    filled = {key: value.format(**groups) for key, value in texts.items()}
    own = {key: v.format(**groups) if isinstance(v, str) else v for key, v in test.conditions.items()}
    return test.model_copy(update={**filled, "conditions": own, "file": file, "pattern": None})


def _measurement(test: TestMap, table: Table, shared: Mapping[str, float]) -> tuple[Measurement, dict[str, str]]:
    """A test in SI units, and the units of its own conditions."""
    where = f"test '{shown(test.name)}'"
    issues = name_issues(where, "test", [test.name])
    issues += channel_name_issues(where, test.channels, {**shared, **test.conditions})
    fixed = {name: value for name, value in test.conditions.items() if not isinstance(value, ColumnMap)}
    own, condition_units = _conditions(where, fixed, issues)
    sensed: dict[str, FloatArray] = {}
    for name, column in test.conditions.items():
        if isinstance(column, ColumnMap):
            with collected(issues):
                sensed[name], condition_units[name] = _column(test, f"condition '{name}'", column, name, table)
    channels: dict[str, dict[str, FloatArray]] = {"input": {}, "output": {}}
    units: dict[str, str] = {}
    for name, column in test.channels.items():
        role = column.role or (CHANNELS[name].role if name in CHANNELS else None)
        if role is None:
            hint = f"Add role = 'input' or 'output'. {did_you_mean(name, CHANNELS)}"
            issues.append(Issue(f"{where}, channel '{name}'", "has no role", hint))
            continue
        with collected(issues):
            channels[role][name], units[name] = _column(test, f"channel '{name}'", column, name, table)
    input_unit = next((units[name] for name in channels["input"]), None)
    numbers: dict[str, float | None] = dict.fromkeys(_UNITS)
    for key, unit in _UNITS.items():
        if (value := getattr(test, key)) is not None:
            with collected(issues):
                numbers[key] = parse_quantity(f"{where}, {key}", value, unit or input_unit)[0]
    raise_errors(issues)
    rate = numbers.pop("sample_rate")
    if test.time is not None:
        time, _ = _column(test, "channel 'time'", test.time, "time", table)
    else:
        length = max((len(v) for group in channels.values() for v in group.values()), default=0)
        time = np.arange(length) / float(rate or 1.0)
    gaps = 0
    if test.gaps == "longest":
        time, gaps = _cut(time, [channels["input"], channels["output"], sensed], numbers)
    time = time - time[0] if time.size else time
    own |= {name: float(np.mean(values)) if values.size else np.nan for name, values in sensed.items()}
    issues = experiment_issues(where, test.procedure, time, channels, numbers["frequency"])
    for name, values in sensed.items():
        if bad := finite_issues(f"{where}, condition '{name}'", values):
            issues += bad
        elif values.size:  # the mean of huge numbers may overflow
            issues += finite_issues(f"{where}, mean of '{name}'", np.atleast_1d(own[name]))
    raise_errors(issues)
    experiment = Experiment(
        test.name, test.procedure, time, channels["input"], {**shared, **own}, **numbers,
        interpolation=test.interpolation,
    )  # fmt: skip
    return Measurement(experiment, channels["output"], units, gaps), condition_units


def _cut(
    time: FloatArray, groups: Sequence[dict[str, FloatArray]], numbers: dict[str, float | None]
) -> tuple[FloatArray, int]:
    """The time of the longest stretch without gaps, to which signals and numbers are cut in place; and the gaps."""
    recorded = [values for group in groups for values in group.values() if len(values) == len(time)]
    kept, gaps = longest_stretch(time, recorded)
    for group in groups:
        group.update({name: values[kept] for name, values in group.items() if len(values) == len(time)})
    if kept.start < kept.stop:
        cut = float(time[kept.start] - time[np.isfinite(time)][0])
        if numbers["start_time"] is not None:
            numbers["start_time"] += cut
        if numbers["transient"] is not None:
            numbers["transient"] = max(numbers["transient"] - cut, 0.0)
    return time[kept], gaps


def _column(test: TestMap, what: str, column: ColumnMap, name: str, table: Table) -> tuple[FloatArray, str]:
    """A column in the known unit of its quantity, or else in the SI unit of its own, and that unit."""
    where = f"test '{test.name}', {what}"
    unit = "s" if name == "time" else known_unit(name)
    values = table.column(column.column)
    own = column.unit if column.unit is not None else table.units.get(table.name_of(column.column))
    if own is None:
        hint = f"Add unit = '{unit or '…'}', or the unit that the file's column is in"
        raise InputError.of(where, f"column '{column.column}' has no unit", hint)
    if test.rows is not None and values.size > 1:
        first, last = test.rows
        if last > len(values):
            message = f"rows {first} to {last} of file '{table.name}', which has {len(values)}"
            raise InputError.of(f"test '{test.name}'", message, "Correct the rows")
        values = values[first - 1 : last]
    scale = column.scale
    if isinstance(scale, str):
        constant = table.column(scale)
        if constant.size != 1:
            message = f"scale '{scale}' has {constant.size} values"
            raise InputError.of(where, message, "Name a constant, or give a number")
        scale = float(constant[0])
    try:
        target = unit or si_unit(own)
        return to_si(scale * values + column.offset, own, target), target
    except UnitError as error:
        hint = f"Give the unit of the file's column{f'; it must convert to {unit!r}' if unit else ''}"
        raise InputError.of(where, str(error), hint) from error


def _conditions(
    where: str, given: Mapping[str, Quantity], issues: list[Issue]
) -> tuple[dict[str, float], dict[str, str]]:
    conditions, units = {}, {}
    for name, value in given.items():
        with collected(issues):
            conditions[name], units[name] = parse_quantity(f"{where}, condition '{name}'", value, known_unit(name))
    return conditions, units
