"""A file as named columns, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from mofit._typing import FloatArray
from mofit.data.importers.contained import Contained
from mofit.data.importers.registry import format_of
from mofit.errors import InputError, Issue, did_you_mean, raise_errors


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file by name, shape (n,) each; constants have one element.

    ``units`` are the file's own, as it spells them, where it has any.
    """

    name: str
    columns: Mapping[str, FloatArray]
    units: Mapping[str, str] = field(default_factory=dict)

    def name_of(self, key: str | int) -> str:
        """Name of a column given by name, or by number from 1.

        Raises
        ------
        InputError
            If there is none; names the closest.
        """
        names = list(self.columns)
        if isinstance(key, int):
            if 1 <= key <= len(names):
                return names[key - 1]
            raise InputError.of(f"file '{self.name}'", f"no column {key}", f"It has columns 1 to {len(names)}")
        if key not in self.columns:
            raise InputError.of(f"file '{self.name}'", f"no column '{key}'", did_you_mean(key, names))
        return key

    def records(self) -> list[str]:
        """What stands before a point of a column's name, in the order of the file: structs, cells, sheets."""
        found: dict[str, None] = {}
        for name in self.columns:
            parts = name.split(".")
            found |= dict.fromkeys(".".join(parts[:end]) for end in range(1, len(parts)))
        return list(found)

    def record(self, name: str) -> Table:
        """The columns of a record by their names inside it, before all others."""
        inner = {column: column[len(name) + 1 :] for column in self.columns if column.startswith(f"{name}.")}
        order = {short: column for column, short in inner.items()}
        order |= {column: column for column in self.columns if column not in inner and column not in order}
        columns = {short: self.columns[column] for short, column in order.items()}
        units = {short: self.units[column] for short, column in order.items() if column in self.units}
        return Table(f"{self.name}, record {name}", columns, units)

    def column(self, key: str | int) -> FloatArray:
        """A column by name, or by number from 1; raises as `name_of`."""
        return self.columns[self.name_of(key)]


def read_table(path: Path, contained: Contained | None = None) -> Table:
    """Read a file of any known format (`mofit.data.importers.registry`).

    Formats that a library parses are read by ``contained``, by default a process for this file alone.

    Raises
    ------
    InputError
        If the format is unknown or the file cannot be read.
    """
    where = f"file '{path.name}'"
    try:
        known = format_of(path)
        if path.stat().st_size == 0:
            raise InputError.of(where, "the file has zero length", "Copy it again")
        if not known.contained:
            return Table(path.name, *known.read(path))
        with nullcontext(contained) if contained else Contained() as process:
            return Table(path.name, *process.columns(path))
    except OSError as error:
        raise InputError.of(where, f"cannot be opened ({error.strerror or error})", "Check its permissions") from error


def source_files(sources: Sequence[Path]) -> dict[str, Path]:
    """All files that the sources (files, and folders of files) offer, by name.

    Raises
    ------
    InputError
        With every source that does not exist, or whose name is given twice.
    """
    files: dict[str, Path] = {}
    issues = []
    for source in sources:
        if not source.exists():
            issues.append(Issue(f"file '{source}'", "there is no such file or folder", "Check the path"))
            continue
        for path in sorted(filter(Path.is_file, source.iterdir())) if source.is_dir() else [source]:
            if path.name in files and not path.samefile(files[path.name]):
                issues.append(Issue(f"file '{path.name}'", "is given twice", "Name only one of them"))
            files[path.name] = path
    raise_errors(issues)
    return files
