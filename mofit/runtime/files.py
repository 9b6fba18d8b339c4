"""Files written whole or not at all, and netCDF trees read wholly into memory."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mofit.errors import InputError, WriteError

if TYPE_CHECKING:
    import xarray as xr

#: values from which a variable is compressed: the header of a chunk takes more than a shorter one saves
_SMALLEST_COMPRESSED = 256
#: bytes of written chunks that HDF5 keeps per variable
_CHUNK_CACHE = 1 << 20


#: Errors of the system after which an output cannot be written.
_REASONS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota on the disk is used up",
    errno.EFBIG: "the file would be larger than the system allows",
    errno.EIO: "the disk fails",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.ENOTDIR: "a part of its path is no folder",
    errno.EEXIST: "a part of its path is no folder",
    errno.ENOENT: "its folder does not exist and cannot be made",
    errno.ENAMETOOLONG: "the name is too long",
}
#: Of those, the ones that come while a file is being written.
_WHILE_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
#: What is needed at least so that a library's error is not laid to the disk [bytes].
_ROOM = 1 << 20


@contextmanager
def writing(path: Path, hint: str = "Make room, then run the command again") -> Iterator[None]:
    """Turn what the system, HDF5 or netCDF raise on a full disk into a `WriteError` about the path, with the hint."""
    try:
        yield
    except WriteError as error:
        raise error.with_hint(hint) from error
    except (OSError, RuntimeError) as error:
        if (number := _write_failure(error, path)) is None:
            raise
        raise WriteError.of(f"'{path}'", f"could not be written: {_REASONS[number]}", hint) from error


def unwritable(where: str, error: Exception) -> InputError:
    """What to say of a place where nothing can be written."""
    if isinstance(error, WriteError):
        return InputError([replace(error.issue, where=where)])
    number = error.errno if isinstance(error, OSError) else None
    reason = _REASONS.get(number or 0) or str(error)
    return InputError.of(where, f"cannot be written: {reason}", "Name another place")


def _write_failure(error: OSError | RuntimeError, path: Path) -> int | None:
    """Number of the system's error behind an exception; None if it has another cause."""
    number = getattr(error, "errno", None)
    if number not in _WHILE_WRITING and (found := re.search(r"errno = (\d+)", str(error))):
        number = int(found[1])  # HDF5 tells it in its text
    if number not in _WHILE_WRITING and "HDF error" in str(error):
        number = _no_room(path)  # netCDF does not tell it
    return number if number in _WHILE_WRITING else None


def _no_room(path: Path) -> int | None:
    """What the system says to a megabyte more in a file, or in a folder."""
    probe = (path if path.is_dir() else path.parent) / f".{os.getpid()}.probe"
    size = path.stat().st_size if path.is_file() else 0
    try:
        handle = os.open(probe, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            os.posix_fallocate(handle, size, _ROOM)
        finally:
            os.close(handle)
            probe.unlink(missing_ok=True)
    except OSError as error:
        return error.errno
    return None


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, which takes its place when the block ends well and vanishes otherwise.

    The content reaches the disk before the name changes, so a crash at any moment leaves the old file or the new one.

    Raises
    ------
    WriteError
        If the disk is full; the old file stays.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        with writing(temporary):
            yield temporary
            _sync(temporary)
            os.replace(temporary, path)
            _sync(path.parent)
    finally:
        with suppress(OSError):  # of a path that cannot be, too
            temporary.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: Path, content: bytes) -> None:
    """Write a binary file, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_tree(path: Path, hint: str, *, indexes: bool = True) -> xr.DataTree:
    """All of a netCDF-4 file in memory; the file is closed again. Times are not decoded.

    Making ``indexes`` of the coordinates imports much, and takes several times as long as reading.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read; with the ``hint`` if it is damaged.
    """
    import xarray as xr  # late: its import takes a fifth of a second, and most who write files need none

    where = f"file '{path.name}'"
    if not path.is_file():
        raise InputError.of(where, f"there is no file '{path}'", "Check the path")
    if path.stat().st_size == 0:
        raise InputError.of(where, "the file has zero length", hint)
    try:
        with xr.open_datatree(path, engine="netcdf4", decode_times=False, create_default_indexes=indexes) as opened:
            tree = loaded(opened.load())
    except Exception as error:  # noqa: BLE001  a damaged file raises anything, from OSError to RuntimeError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        message = f"not a readable netCDF-4 file: truncated, damaged or of another kind ({reason})"
        raise InputError.of(where, message, hint) from None
    return tree


def loaded(tree: xr.DataTree) -> xr.DataTree:
    """A tree, all of its numbers in memory; xarray's own ``load`` leaves some for later."""
    for node in tree.subtree:
        for variable in node.variables.values():
            variable.load()
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
    with atomic_path(path) as temporary, _small_chunk_cache():
        tree.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


@contextmanager
def _small_chunk_cache() -> Iterator[None]:
    """Chunks are written once and whole: caches of 64 MB per variable would hold all of the file until it is closed."""
    import netCDF4  # late: its import takes a tenth of a second

    usual = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(_CHUNK_CACHE)
    try:
        yield
    finally:
        netCDF4.set_chunk_cache(*usual)
