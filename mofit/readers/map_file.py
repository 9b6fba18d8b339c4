"""The map file: which column of which file is which channel of which test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from mofit.errors import Fault, InputError, did_you_mean
from mofit.toml_file import read_toml
from mofit.units import UnitError, si_unit, to_si


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


#: a number in SI units, or text with its unit: "25 mm"
Quantity = float | str


class ColumnMap(_Strict):
    """A column and its unit: ``value [unit] = scale * column + offset``.

    ``scale`` may name a constant of the same file. ``unit`` may be left out where the file has it (MDF, TYDEX, a text
    table with a line of units).
    """

    column: str | int
    unit: str | None = None
    role: Literal["input", "output"] | None = None
    scale: float | str = 1.0
    offset: float = 0.0


class TestMap(_Strict):
    """One test, or with ``pattern`` one for every file whose whole name matches.

    Named groups of the pattern fill ``{group}`` in the other texts; ``decimal`` is the sign that
    stands for the decimal point in file names. A condition that is a column is its mean. ``gaps`` says what becomes of
    a record with gaps: it is refused, or its ``longest`` whole stretch is the test.
    """

    name: str
    procedure: str
    file: str | None = None
    pattern: str | None = None
    decimal: str = "."
    frequency: Quantity | None = None
    amplitude: Quantity | None = None
    start_time: Quantity | None = None
    transient: Quantity | None = None
    hold: str = ""
    rows: tuple[int, int] | None = None
    gaps: Literal["refuse", "longest"] = "refuse"
    conditions: dict[str, Quantity | ColumnMap] = Field(default_factory=dict)
    channels: dict[str, ColumnMap] = Field(default_factory=dict)
    time: ColumnMap | None = None
    sample_rate: Quantity | None = None

    @field_validator("rows")
    @classmethod
    def _rows_in_order(cls, rows: tuple[int, int] | None) -> tuple[int, int] | None:
        if rows is not None and not 1 <= rows[0] < rows[1]:
            raise ValueError(f"rows {list(rows)} are not [first, last], counted from 1")
        return rows

    @model_validator(mode="after")
    def _one_file(self) -> TestMap:
        if (self.file is None) == (self.pattern is None):
            raise ValueError("give either 'file' or 'pattern'")
        if (self.time is None) == (self.sample_rate is None):
            raise ValueError("give either 'time' or 'sample_rate'")
        return self


class ImportMap(_Strict):
    """A whole map. ``defaults`` holds entries that every test takes where it has none of its own."""

    title: str
    source: Literal["measured", "simulated"] = "measured"
    attributes: dict[str, str | float | int] = Field(default_factory=dict)
    conditions: dict[str, Quantity] = Field(default_factory=dict)
    tests: tuple[TestMap, ...] = Field(min_length=1)


def read_map(path: Path) -> ImportMap:
    """Read and check a map file.

    Raises
    ------
    InputError
        With every fault: no TOML, unknown or missing keys, values of the wrong kind.
    """
    return read_toml(path, "map", ImportMap, _with_defaults, _fault)


def quantity(where: str, value: Quantity, unit: str | None) -> tuple[float, str]:
    """A quantity in SI units and its unit; a text must bring its unit.

    Raises
    ------
    InputError
        If the text is no number with a unit, or the unit does not fit ``unit``.
    """
    if not isinstance(value, str):
        return float(value), unit or "1"
    number, _, given = value.strip().partition(" ")
    try:
        target = unit or si_unit(given)
        return float(to_si(float(number), given, target)), target
    except (ValueError, UnitError) as error:
        raise InputError.of(where, f"'{value}': {error}", "Write a number and its unit, like '25 mm'") from error


def _with_defaults(content: Mapping[str, Any]) -> dict[str, Any]:
    rest = {key: value for key, value in content.items() if key != "defaults"}
    defaults, tests = content.get("defaults", {}), content.get("tests")
    if isinstance(defaults, dict) and isinstance(tests, list):
        rest["tests"] = [_over(defaults, test) if isinstance(test, dict) else test for test in tests]
    return rest


def _over(defaults: Mapping[str, Any], test: Mapping[str, Any]) -> dict[str, Any]:
    """The test's entries over the defaults; of rival entries the test's own wins."""
    rivals = {"file": "pattern", "pattern": "file", "time": "sample_rate", "sample_rate": "time"}
    kept = {key: value for key, value in defaults.items() if rivals.get(key) not in test}
    merged = {**kept, **test}
    for table in ("channels", "conditions"):
        if isinstance(kept.get(table), dict) and isinstance(test.get(table), dict):
            merged[table] = {**kept[table], **test[table]}
    return merged


def _fault(where: str, problem: Mapping[str, Any]) -> Fault:
    place = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in problem["loc"])
    if problem["type"] == "extra_forbidden":
        model = TestMap if "tests" in problem["loc"] else ImportMap
        model_keys = (
            ColumnMap.model_fields
            if {"channels", "time", "conditions"} & set(problem["loc"][:-1])
            else model.model_fields
        )
        known = [*model_keys, *(["defaults"] if model is ImportMap else [])]
        return Fault(f"{where}, {place}", "unknown key", did_you_mean(str(problem["loc"][-1]), known))
    if problem["type"] == "missing":
        return Fault(f"{where}, {place}", "missing", "Add it; docs/campaigns.md lists every key")
    what = str(problem["msg"]).removeprefix("Value error, ")
    return Fault(f"{where}, {place or 'map'}", what, "See the map file's format in docs/campaigns.md")
