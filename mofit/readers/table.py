"""A file as named columns, whatever its format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.errors import InputError, did_you_mean
from mofit.readers.mat import mat_columns
from mofit.readers.text import text_columns

Array = NDArray[np.float64]

#: reader of every file name ending; a new format is one function and one line here
READERS: dict[str, Callable[[Path], dict[str, Array]]] = {
    ".csv": text_columns,
    ".txt": text_columns,
    ".dat": text_columns,
    ".asc": text_columns,
    ".tsv": text_columns,
    ".mat": mat_columns,
}


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file by name, shape (n,) each; constants have one element."""

    name: str
    columns: Mapping[str, Array]

    def column(self, key: str | int) -> Array:
        """A column by name, or by number from 1.

        Raises
        ------
        InputError
            If there is none; names the closest.
        """
        names = list(self.columns)
        if isinstance(key, int):
            if 1 <= key <= len(names):
                return self.columns[names[key - 1]]
            raise InputError.of(f"file '{self.name}'", f"no column {key}", f"It has columns 1 to {len(names)}")
        if key not in self.columns:
            raise InputError.of(f"file '{self.name}'", f"no column '{key}'", did_you_mean(key, names))
        return self.columns[key]


def read_table(path: Path) -> Table:
    """Read a file by the ending of its name (``.gz`` may follow).

    Raises
    ------
    InputError
        If the format is unknown or the file cannot be read.
    """
    where = f"file '{path.name}'"
    endings = [ending.lower() for ending in path.suffixes if ending.lower() != ".gz"]
    ending = endings[-1] if endings else ""
    if ending not in READERS:
        raise InputError.of(where, f"unknown format '{ending}'", did_you_mean(ending, READERS))
    if path.stat().st_size == 0:
        raise InputError.of(where, "the file has zero length", "Copy it again")
    return Table(path.name, READERS[ending](path))
