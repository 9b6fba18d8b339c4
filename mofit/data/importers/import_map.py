"""The map file: which column of which file is which channel of which test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from mofit.runtime.toml import Strict, read_toml
from mofit.units import Quantity


class ColumnMap(Strict):
    """A column and its unit: ``value [unit] = scale * column + offset``.

    ``scale`` may name a constant of the same file. ``unit`` may be left out where the file has it (MDF, TYDEX, a text
    table with a line of units, a clock). A column of another rate has its own ``time`` or ``sample_rate``; then the
    test needs ``resample``.
    """

    column: str | int
    unit: str | None = None
    role: Literal["input", "output"] | None = None
    scale: float | str = 1.0
    offset: float = 0.0
    time: ColumnMap | None = None
    sample_rate: Quantity | None = None


class ModuliMap(Strict):
    """Columns of a table of dynamic moduli (DMA), a row per frequency.

    ``storage`` and ``loss`` are stiffnesses (N/m) or moduli (Pa). ``deviation`` is the relative standard deviation of
    both.
    """

    frequency: ColumnMap
    storage: ColumnMap
    loss: ColumnMap
    temperature: ColumnMap | None = None
    deviation: float = Field(gt=0.0, lt=1.0)


class TestMap(Strict):
    """One test, or with ``pattern`` one for every file whose whole name matches.

    Named groups of the pattern fill ``{group}`` in the other texts; ``decimal`` is the sign that
    stands for the decimal point in file names. With ``records`` it is one test for every record inside the file whose
    whole name matches. A condition that is a column is its mean. With ``resample`` the record is brought to that rate,
    and every stretch without gaps becomes a test; a gap is longer than ``max_gap``. Without, a record with ``gaps`` is
    refused. In both cases its ``longest`` stretch may be the only test. With ``moduli`` the file is no record but a
    table, and every row becomes a sine test.
    """

    renamed: ClassVar[Mapping[str, str]] = {"hold": "interpolation"}

    name: str
    procedure: str
    file: str | None = None
    pattern: str | None = None
    records: str | None = None
    decimal: str = "."
    frequency: Quantity | None = None
    amplitude: Quantity | None = None
    start_time: Quantity | None = None
    transient: Quantity | None = None
    interpolation: str = ""
    rows: tuple[int, int] | None = None
    gaps: Literal["refuse", "longest"] | None = None
    max_gap: Quantity | None = None
    resample: Quantity | None = None
    conditions: dict[str, Quantity | ColumnMap] = Field(default_factory=dict)
    channels: dict[str, ColumnMap] = Field(default_factory=dict)
    time: ColumnMap | None = None
    sample_rate: Quantity | None = None
    moduli: ModuliMap | None = None

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
        if self.moduli is None and (self.time is None) == (self.sample_rate is None):
            raise ValueError("give either 'time' or 'sample_rate'")
        if self.max_gap is not None and self.resample is None:
            raise ValueError("'max_gap' needs 'resample'")
        return self


class ImportMap(Strict):
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
        With every issue: no TOML, unknown or missing keys, values of the wrong kind.
    """
    return read_toml(path, "map", ImportMap, "docs/campaigns.md", _with_defaults)


def _with_defaults(defaults: Mapping[str, Any], test: Mapping[str, Any]) -> dict[str, Any]:
    """The test's entries over the defaults; of rival entries the test's own wins."""
    rivals = {"file": "pattern", "pattern": "file", "time": "sample_rate", "sample_rate": "time"}
    kept = {key: value for key, value in defaults.items() if rivals.get(key) not in test}
    merged = {**kept, **test}
    for table in ("channels", "conditions"):
        if isinstance(kept.get(table), dict) and isinstance(test.get(table), dict):
            merged[table] = {**kept[table], **test[table]}
    return merged
