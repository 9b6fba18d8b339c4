"""Which columns of a table are time, channels and conditions: by their names, else their units, else their shapes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.channel_aliases import FAMILIES, TIME, fits, key, name_and_unit, read_unit
from mofit.data.importers.shapes import Roles, looks_like_time, roles_by_shape
from mofit.data.importers.table import Table
from mofit.errors import InputError
from mofit.quantities import CHANNELS, known_unit
from mofit.units import is_unit, to_si

#: columns that a message names
_NAMED = 6
#: columns of the most that shapes are compared of
_COMPARED = 24
#: families that units alone can mean: no tyre, whose angle and force have the same as others
_PLAIN = (("displacement", "force"), ("angle", "torque"), ("current", "voltage"))
#: constants that loggers call their time step and their rate
_STEP, _RATE = ("ts", "dt", "ta", "tsample", "sampletime"), ("fs", "samplerate", "samplingrate", "abtastrate")
#: words in names of columns that count or sum up
_NO_SIGNAL = ("step", "cycle", "cycles", "segment", "index", "count", "scan", "sample", "nr", "no")


@dataclass(frozen=True)
class Guess:
    """A column taken for a quantity, with a remark on how it and its unit were found."""

    column: str
    unit: str
    remark: str = ""
    role: str = ""
    """Where the quantity has no usual one."""


@dataclass(frozen=True)
class Channels:
    """Channels of one test by name, the names of columns that may be conditions, and remarks on other columns."""

    found: Mapping[str, Guess]
    conditions: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    name: str = ""
    """What tells this test from others of the same file."""

    @property
    def driver(self) -> Guess:
        """The first input."""
        return next(iter(self.found.values()))


def find_time(table: Table, rows: int | None = None) -> Guess | None:
    """The column of the time: by its name, or the only one that increases in even steps."""
    named = find(table, "time", TIME, rows)
    if named:
        return named
    rising = [
        name
        for name, values in table.columns.items()
        if (rows is None or len(values) == rows)
        and looks_like_time(values)
        and fits("time", _unit(table, name, "time"))
    ]
    if len(rising) != 1 or key(rising[0]) in _NO_SIGNAL:
        return None
    unit = _unit(table, rising[0], "time")
    return Guess(rising[0], unit or "s", f"the only column that increases evenly{'' if unit else '; unit guessed'}")


def sample_rate(table: Table) -> str | None:
    """The rate that a constant of the file states, in words for a map."""
    for name, values in table.columns.items():
        known = values[np.isfinite(values)]
        if known.size == 0 or np.ptp(known) > 0 or not known[0] > 0 or (len(values) > 1 and known.size > 1):
            continue
        if key(name) in _STEP:
            return f"{1 / known[0]:.10g} Hz"
        if key(name) in _RATE:
            return f"{known[0]:.10g} Hz"
    return None


def find_channels(table: Table) -> list[Channels]:
    """Input and output of every test in a table, at least one test.

    Raises
    ------
    InputError
        If none are found; names some of the columns.
    """
    for family in FAMILIES:
        found: dict[str, Guess] = {}
        rows: int | None = None
        for name, words in family.spellings.items():
            guess = find(table, name, words.split(), rows, {g.column for g in found.values()})
            if guess:
                found[name] = guess
                rows = len(table.column(guess.column))
        if set(family.needed) <= set(found):
            return [Channels(found, family.conditions)]
    if pairs := _symbol_pairs(table):
        return pairs
    if shaped := _by_shape(table):
        return [shaped]
    names = list(table.columns)
    columns = ", ".join(f"{name[:30]} [{table.units.get(name, '?')[:12]}]" for name in names[:_NAMED])
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    hint = "Write the map by hand (docs/campaigns.md), or name the columns like 'slip_angle' and 'lateral_force'"
    raise InputError.of(f"file '{table.name}'", f"no input and output found among its columns: {columns}{more}", hint)


def _symbol_pairs(table: Table) -> list[Channels]:
    """Columns ``u`` and ``y`` with the same ending, as control engineering calls input and output."""
    pairs = []
    for name, values in table.columns.items():
        match = re.fullmatch(r"(?:.*\.)?u_?([A-Za-z0-9]*)", name)
        other = re.sub(r"u(_?[A-Za-z0-9]*)$", r"y\1", name)
        if match and other in table.columns and len(table.column(other)) == len(values) > 7:
            remark = "unit unknown: state it, and give the channel the name that your model has"
            found = {
                symbol: Guess(column, table.units.get(column, "1"), remark, role)
                for symbol, column, role in (("u", name, "input"), ("y", other, "output"))
            }
            pairs.append(Channels(found, name=match[1]))
    return pairs


def _by_shape(table: Table) -> Channels | None:
    """Channels by the units of the columns where these decide, else by their shapes."""
    time = find_time(table)
    rows = max((len(values) for values in table.columns.values()), default=0)
    columns = {
        name: values
        for name, values in table.columns.items()
        if len(values) == rows and (time is None or name != time.column) and key(name) not in (*_NO_SIGNAL, *TIME)
    }
    columns = dict(list(columns.items())[:_COMPARED])
    with np.errstate(all="ignore"):
        stamps = None if time is None else to_si(table.column(time.column), time.unit, "s")
        roles = roles_by_shape(stamps, columns)
    return None if roles is None else _by_unit(table, columns, roles) or _named_by_shape(table, roles)


def _by_unit(table: Table, columns: Mapping[str, FloatArray], roles: Roles) -> Channels | None:
    """Channels of the first family whose input and output each have a column of their unit."""
    given = {name: unit for name in columns if (unit := _given_unit(table, name))}
    for family in (family for family in FAMILIES if family.needed in _PLAIN):
        driver, response = (
            [name for name, unit in given.items() if fits(q, unit) and name not in roles.derivatives]
            for q in family.needed
        )
        if driver and response and set(driver).isdisjoint(response):
            chosen = roles.driver if roles.driver in driver else driver[0]
            answers = roles.response if roles.response in response else response[0]
            found = {
                quantity: Guess(column, str(read_unit(given[column], quantity)), "by its unit: check that it is this")
                for quantity, column in zip(family.needed, (chosen, answers), strict=True)
            }
            return Channels(found, family.conditions, _remarks(roles))
    return None


def _named_by_shape(table: Table, roles: Roles) -> Channels:
    """Channels that only their shapes tell: a motion has a derivative, of others the quantity is unknown."""
    names = ("displacement", "force") if roles.driver in roles.derivatives.values() else ("input", "output")
    found = {}
    for name, column, why in (
        (names[0], roles.driver, f"drives: {roles.reason}"),
        (names[1], roles.response, "responds"),
    ):
        unit = _given_unit(table, column)
        unit = unit if unit and (name not in CHANNELS or fits(name, unit)) else None
        guessed = likely_unit(name, table.column(column)) if name in CHANNELS else "1"
        role = "" if name in CHANNELS else {"input": "input", "output": "output"}[name]
        remark = why if unit else f"{why}; unit guessed from the values: check it"
        if name not in CHANNELS:
            remark += "; give the channel the name that your model has"
        found[name] = Guess(column, unit or guessed, remark, role)
    return Channels(found, remarks=_remarks(roles))


def _remarks(roles: Roles) -> dict[str, str]:
    return {name: f"the derivative of '{of}'" for name, of in roles.derivatives.items()}


def _given_unit(table: Table, column: str) -> str | None:
    """The unit that the file or the column's header states."""
    if (unit := table.units.get(column)) and is_unit(unit):
        return unit
    return name_and_unit(column, "")[1]


def _unit(table: Table, column: str, quantity: str) -> str | None:
    unit = name_and_unit(column, quantity)[1]
    if given := table.units.get(column):
        unit = read_unit(given, quantity) or given
    return unit


def find(
    table: Table, quantity: str, words: Sequence[str], rows: int | None, taken: set[str] | frozenset[str] = frozenset()
) -> Guess | None:
    """The column spelt the most usual way, of this length, whose unit fits; constants are no channels."""
    wanted = {quantity.replace("_", ""): -1, **{word: rank for rank, word in reversed(list(enumerate(words)))}}
    ranked = []
    for order, (column, values) in enumerate(table.columns.items()):
        name = name_and_unit(column, quantity)[0]
        unit = _unit(table, column, quantity)
        rank = min((wanted[k] for k in (key(name), key(column)) if k in wanted), default=None)
        long_enough = len(values) == rows if rows else len(values) > 1 or quantity in _SIZES
        # a date beside a clock is text, and no number is left of it
        known = len(values) < 2 or bool(np.isfinite(values).any())
        if rank is not None and long_enough and known and column not in taken and fits(quantity, unit):
            ranked.append((rank, order, column, unit))
    if not ranked:
        return None
    _, _, column, unit = min(ranked)
    role = "" if quantity in CHANNELS or quantity not in _ROLES else _ROLES[quantity]
    if unit:
        return Guess(column, unit, role=role)
    return Guess(column, likely_unit(quantity, table.column(column)), "unit guessed from the values: check it", role)


#: roles of channels of families that `mofit.quantities` does not know as channels
_ROLES = {"current": "input", "voltage": "output"}

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
    "voltage": ((np.inf, "V"),),
    "time": ((np.inf, "s"),),
}


def likely_unit(quantity: str, values: FloatArray) -> str:
    """The unit in which values of this size are usual."""
    size = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    return next((unit for limit, unit in _SIZES.get(quantity, ()) if size < limit), known_unit(quantity) or "1")
