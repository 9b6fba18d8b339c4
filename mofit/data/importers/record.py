"""What a map takes from one table for one test, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.import_map import ColumnMap, TestMap
from mofit.data.importers.table import Table
from mofit.data.names import channel_name_issues, name_issues, shown
from mofit.errors import InputError, Issue, collected, did_you_mean, raise_errors
from mofit.quantities import CHANNELS, known_unit
from mofit.units import Quantity, UnitError, parse_quantity, si_unit, to_si

#: SI unit of a test's numbers; that of the amplitude is the unit of the first input
_UNITS = {
    "frequency": "Hz", "amplitude": None, "start_time": "s", "transient": "s", "sample_rate": "Hz", "resample": "Hz",
    "max_gap": "s",
}  # fmt: skip


@dataclass(eq=False)
class Record:
    """One test as recorded: nothing is cut or resampled yet.

    ``channels`` by role and name, ``sensed`` conditions (whose mean counts), and ``times``, all of shape (n,) each;
    ``times`` holds the stamps of channels that have their own. ``numbers`` are those of the map, None where it has
    none.
    """

    time: FloatArray = field(default_factory=lambda: np.zeros(0))
    channels: dict[str, dict[str, FloatArray]] = field(default_factory=lambda: {"input": {}, "output": {}})
    sensed: dict[str, FloatArray] = field(default_factory=dict)
    times: dict[str, FloatArray] = field(default_factory=dict)
    numbers: dict[str, float | None] = field(default_factory=lambda: dict.fromkeys(_UNITS))
    conditions: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    condition_units: dict[str, str] = field(default_factory=dict)

    @property
    def signals(self) -> dict[str, FloatArray]:
        """Channels and sensed conditions by name."""
        return {**self.channels["input"], **self.channels["output"], **self.sensed}


def read_record(test: TestMap, table: Table, shared: Mapping[str, float]) -> Record:
    """The record of a test; ``shared`` are the conditions of the campaign.

    Raises
    ------
    InputError
        With every issue of names, columns and units.
    """
    where = f"test '{shown(test.name)}'"
    record = Record()
    issues = name_issues(where, "test", [test.name])
    issues += channel_name_issues(where, test.channels, {**shared, **test.conditions})
    fixed = {name: value for name, value in test.conditions.items() if not isinstance(value, ColumnMap)}
    record.conditions, record.condition_units = read_conditions(where, fixed, issues)
    for name, column in test.conditions.items():
        if isinstance(column, ColumnMap):
            with collected(issues):
                record.sensed[name], record.condition_units[name] = read_column(test, "condition", column, name, table)
                _own_time(test, column, name, table, record)
    for name, column in test.channels.items():
        role = column.role or (CHANNELS[name].role if name in CHANNELS else None)
        if role is None:
            hint = f"Add role = 'input' or 'output'. {did_you_mean(name, CHANNELS)}"
            issues.append(Issue(f"{where}, channel '{name}'", "has no role", hint))
            continue
        with collected(issues):
            record.channels[role][name], record.units[name] = read_column(test, "channel", column, name, table)
            _own_time(test, column, name, table, record)
    input_unit = next((record.units[name] for name in record.channels["input"]), None)
    for key, unit in _UNITS.items():
        if (value := getattr(test, key)) is not None:
            with collected(issues):
                record.numbers[key] = parse_quantity(f"{where}, {key}", value, unit or input_unit)[0]
    raise_errors(issues)
    rate = record.numbers.pop("sample_rate")
    if test.time is not None:
        record.time, _ = read_column(test, "channel", test.time, "time", table)
    else:
        own = [len(values) for name, values in record.signals.items() if name not in record.times]
        record.time = np.arange(max(own, default=0)) / float(rate or 1.0)
    return record


def _own_time(test: TestMap, column: ColumnMap, name: str, table: Table, record: Record) -> None:
    """Add the stamps of a column that has its own."""
    if column.time is not None:
        record.times[name], _ = read_column(test, f"time of '{name}', channel", column.time, "time", table)
    elif column.sample_rate is not None:
        where = f"test '{test.name}', channel '{name}', sample_rate"
        rate, _ = parse_quantity(where, column.sample_rate, "Hz")
        record.times[name] = np.arange(len(record.signals[name])) / rate


def read_column(test: TestMap, what: str, column: ColumnMap, name: str, table: Table) -> tuple[FloatArray, str]:
    """A column in the known unit of its quantity, or else in the SI unit of its own, and that unit.

    Raises
    ------
    InputError
        If there is no such column, or its unit is missing or does not fit; ``what`` says what it is wanted for.
    """
    where = f"test '{test.name}', {what} '{name}'"
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


def read_conditions(
    where: str, given: Mapping[str, Quantity], issues: list[Issue]
) -> tuple[dict[str, float], dict[str, str]]:
    """Conditions in SI units, and these units; what cannot be read is added to the issues."""
    conditions, units = {}, {}
    for name, value in given.items():
        with collected(issues):
            conditions[name], units[name] = parse_quantity(f"{where}, condition '{name}'", value, known_unit(name))
    return conditions, units
