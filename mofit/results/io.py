"""The result file of a run: written atomically, read whole, checked both times."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from mofit.errors import Issue, raise_errors
from mofit.results.check import check_result
from mofit.runtime.files import read_tree, write_tree

RESULT_FILE = "result.nc"


def write_result(tree: xr.DataTree, folder: Path | str) -> Path:
    """Write ``result.nc`` (netCDF-4, compressed) into a run folder, atomically.

    Parameters
    ----------
    tree
        A ``mofit.result/2`` tree.
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
    # nearly the size of level 9 on sampled signals, several times faster
    write_tree(tree, target, level=1)
    return target


def open_result(source: Path | str) -> xr.DataTree:
    """Read a run wholly into memory; the file is closed again.

    Parameters
    ----------
    source
        A run folder, or its ``result.nc``.

    Raises
    ------
    InputError
        If the file is missing, damaged, or not a ``mofit.result/2`` tree; with all issues.
    """
    path = Path(source)
    if path.is_dir():
        path = path / RESULT_FILE
    loaded = read_tree(path, "Give the folder or result.nc of a finished run, or run the identification again")
    issues = check_result(loaded)
    raise_errors(Issue(f"{path.name}, {issue.where}", issue.message, issue.hint, issue.severity) for issue in issues)
    return loaded
