"""A file as named columns, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mofit.errors import InputError, did_you_mean
from mofit.readers.columns import Array, Columns
from mofit.readers.contained import Contained
from mofit.readers.text import text_columns
from mofit.readers.tydex import is_tydex, tydex_columns

#: reader of every text format by file name ending; a new format is one function and one line here
TEXT_READERS: dict[str, Callable[[Path], Columns]] = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".asc", ".tsv"), text_columns),
    **dict.fromkeys((".tdx", ".tydex"), tydex_columns),
}
#: formats that a library parses, in a process of its own
BINARY = (".mat", ".mf4", ".mdf")


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file by name, shape (n,) each; constants have one element.

    ``units`` are the file's own, as it spells them, where it has any.
    """

    name: str
    columns: Mapping[str, Array]
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

    def column(self, key: str | int) -> Array:
        """A column by name, or by number from 1; raises as `name_of`."""
        return self.columns[self.name_of(key)]


def read_table(path: Path, contained: Contained | None = None) -> Table:
    """Read a file by the ending of its name (``.gz`` may follow); TYDEX is told by its first lines too.

    Parameters
    ----------
    path
        The file.
    contained
        Process that reads MAT and MDF files; by default one for this file alone.

    Raises
    ------
    InputError
        If the format is unknown or the file cannot be read.
    """
    where = f"file '{path.name}'"
    endings = [ending.lower() for ending in path.suffixes if ending.lower() != ".gz"]
    ending = endings[-1] if endings else ""
    if ending not in (*TEXT_READERS, *BINARY):
        raise InputError.of(where, f"unknown format '{ending}'", did_you_mean(ending, (*TEXT_READERS, *BINARY)))
    try:
        if path.stat().st_size == 0:
            raise InputError.of(where, "the file has zero length", "Copy it again")
        return Table(path.name, *_columns(path, ending, contained))
    except OSError as error:
        raise InputError.of(where, f"cannot be opened ({error.strerror or error})", "Check its permissions") from error


def _columns(path: Path, ending: str, contained: Contained | None) -> Columns:
    if ending not in BINARY:
        return (tydex_columns if is_tydex(path) else TEXT_READERS[ending])(path)
    if contained is not None:
        return contained.columns(path)
    with Contained() as own:
        return own.columns(path)
