"""Files written whole or not at all, and netCDF trees read wholly into memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from mofit.errors import InputError

#: values from which a variable is compressed: the header of a chunk takes more than a shorter one saves
_SMALLEST_COMPRESSED = 256


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, which takes its place when the block ends well and vanishes otherwise.

    The content reaches the disk before the name changes, so a crash at any moment leaves the old file or the new one.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        _sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_tree(path: Path, hint: str) -> xr.DataTree:
    """All of a netCDF-4 file in memory; the file is closed again. Times are not decoded.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read; with the ``hint`` if it is damaged.
    """
    where = f"file '{path.name}'"
    if not path.is_file():
        raise InputError.of(where, f"there is no file '{path}'", "Check the path")
    if path.stat().st_size == 0:
        raise InputError.of(where, "the file has zero length", hint)
    try:
        with xr.open_datatree(path, engine="netcdf4", decode_times=False) as opened:
            tree = opened.load()
            # not every variable is read by that; one that is not would open the file again later, for good
            for node in tree.subtree:
                for variable in node.variables.values():
                    variable.load()
    except Exception as error:  # noqa: BLE001  a damaged file raises anything, from OSError to RuntimeError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        message = f"not a readable netCDF-4 file: truncated, damaged or of another kind ({reason})"
        raise InputError.of(where, message, hint) from None
    return tree


def write_tree(tree: xr.DataTree, path: Path, level: int) -> None:
    """Write a netCDF-4 file, atomically; long numeric variables are deflated (``level`` 1 to 9) with byte shuffle."""
    packed = {"zlib": True, "complevel": level, "shuffle": True}
    encoding = {
        node.path: {
            str(name): packed
            for name, variable in node.to_dataset(inherit=False).variables.items()
            if variable.dtype.kind in "fiu" and variable.size >= _SMALLEST_COMPRESSED
        }
        for node in tree.subtree
    }
    with atomic_path(path) as temporary:
        tree.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
