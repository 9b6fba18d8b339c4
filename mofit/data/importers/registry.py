"""Import formats: what one declares, and which there are."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from mofit._typing import FloatArray
from mofit.errors import InputError, did_you_mean

#: columns by name, shape (n,) each, and the unit of those that have one, as the file spells it
Columns = tuple[dict[str, FloatArray], dict[str, str]]

#: bytes at the start of a file that a format is recognised by
_START = 4096


@dataclass(frozen=True)
class ImportLimits:
    """How much one file may hold; a file that claims more is damaged."""

    expansion: int = 1032
    """Bytes that deflate can make of one."""
    unpacked: int = 4 << 30
    """Bytes of the unpacked file: what the memory of a usual computer holds beside the columns."""

    def check(self, path: Path, claimed: int) -> None:
        """Refuse a file that claims to hold ``claimed`` bytes, before anything is allocated.

        Raises
        ------
        InputError
            If the claim is above the limits, or negative.
        """
        size = path.stat().st_size
        if not 0 <= claimed <= min(self.expansion * size, self.unpacked):
            message = f"claims to hold {claimed:.3g} bytes in {size} bytes of file"
            raise InputError.of(f"file '{path.name}'", message, "The file is damaged or cut off: copy or export again")


LIMITS = ImportLimits()


@dataclass(frozen=True)
class ImportFormat:
    """A file format, as its module in `mofit.data.importers.formats` declares it."""

    name: str
    """For messages and tables: ``"MAT"``."""
    versions: str
    """Which versions of it are read; may be empty."""
    endings: tuple[str, ...]
    """Endings of file names, with the point."""
    columns: str
    units: str
    """For the docs: what becomes a column, and where its unit comes from."""
    read: Callable[[Path], Columns]
    """Reads a file. It raises `InputError`; in a contained process it may raise anything."""
    contained: bool = False
    """Whether a library parses it, which a damaged file may hang or crash: it is then read in a process of its own."""
    recognises: Callable[[bytes], bool] | None = None
    """Whether the first bytes are of this format, for files that have the ending of another one."""
    package: str = ""
    extra: str = ""
    """Python package that reads it, and the extra of mofit that installs it."""


@cache
def import_formats() -> tuple[ImportFormat, ...]:
    """Every format that a module of `mofit.data.importers.formats` declares, by the name of the module."""
    package = import_module("mofit.data.importers.formats")
    modules = [import_module(f"{package.__name__}.{found.name}") for found in iter_modules(package.__path__)]
    return tuple(value for module in modules for value in vars(module).values() if isinstance(value, ImportFormat))


def known_endings() -> tuple[str, ...]:
    """Endings of all formats, in their order."""
    return tuple(ending for known in import_formats() for ending in known.endings)


def format_of(path: Path) -> ImportFormat:
    """The format by the ending of the file's name, ``.gz`` aside; text of another format by its first bytes.

    Raises
    ------
    InputError
        If the ending is unknown.
    """
    endings = [ending.lower() for ending in path.suffixes if ending.lower() != ".gz"]
    ending = endings[-1] if endings else ""
    named = next((known for known in import_formats() if ending in known.endings), None)
    if named is None:
        hint = did_you_mean(ending, known_endings())
        raise InputError.of(f"file '{path.name}'", f"unknown format '{ending}'", hint)
    if named.contained:
        return named
    start = _start_of(path)
    return next((known for known in import_formats() if known.recognises and known.recognises(start)), named)


def _start_of(path: Path) -> bytes:
    """First bytes of a file, unpacked; of a damaged gzip file none."""
    with path.open("rb") as file:
        start = file.read(_START)
    if start[:2] != b"\x1f\x8b":
        return start
    try:
        return zlib.decompressobj(31).decompress(start, _START)
    except zlib.error:
        return b""
