"""The run folder: a result is written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from mofit.errors import Fault, InputError, raise_errors
from mofit.netcdf import read_tree
from mofit.result.layout import check_result

RESULT_FILE = "result.nc"

# Deflate level 1 with byte shuffle: nearly the size of level 9 on sampled signals, several times faster.
_COMPRESSION = {"zlib": True, "complevel": 1, "shuffle": True}
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


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_result(tree: xr.DataTree, folder: Path | str) -> Path:
    """Write ``result.nc`` (netCDF-4, compressed) into a run folder, atomically.

    Parameters
    ----------
    tree
        A ``mofit.result/1`` tree.
    folder
        Created if it isn't there.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the tree isn't as `check_result` wants it; nothing is written then.
    """
    raise_errors(check_result(tree))
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / RESULT_FILE
    with atomic_path(target) as temporary:
        tree.to_netcdf(temporary, engine="netcdf4", encoding=_encoding(tree))
    return target


def _encoding(tree: xr.DataTree) -> dict[str, dict[str, dict[str, object]]]:
    return {
        node.path: {
            str(name): dict(_COMPRESSION)
            for name, variable in node.to_dataset(inherit=False).variables.items()
            if variable.dtype.kind in "fiu" and variable.size >= _SMALLEST_COMPRESSED
        }
        for node in tree.subtree
    }


def open_result(source: Path | str) -> xr.DataTree:
    """Read a run wholly into memory; the file is closed again.

    Parameters
    ----------
    source
        A run folder, or its ``result.nc``.

    Raises
    ------
    InputError
        If the file is missing, damaged, or not a ``mofit.result/1`` tree; with all faults.
    """
    path = Path(source)
    if path.is_dir():
        path = path / RESULT_FILE
    if not path.is_file():
        cure = "Give the folder of a finished run" if path.parent.is_dir() else "Check the spelling of the folder"
        raise InputError.of(str(path), "there is no such file", cure)
    try:
        loaded = read_tree(path)
    except (OSError, RuntimeError, ValueError) as error:
        what = "the file is empty" if path.stat().st_size == 0 else f"it can't be read as netCDF-4 ({error})"
        raise InputError.of(
            str(path), what, "The file is damaged or something else: run the identification again"
        ) from None
    faults = check_result(loaded)
    raise_errors(Fault(f"{path.name}, {fault.where}", fault.what, fault.cure, fault.severity) for fault in faults)
    return loaded
