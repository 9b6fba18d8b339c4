"""Trees of netCDF files, read wholly into memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr


def read_tree(path: Path, **options: Any) -> xr.DataTree:
    """All of a netCDF-4 file; the file is closed again. Options are those of `xarray.open_datatree`."""
    with xr.open_datatree(path, engine="netcdf4", **options) as opened:
        tree = opened.load()
        # not every variable is read by that; one that is not would open the file again later, for good
        for node in tree.subtree:
            for variable in node.variables.values():
                variable.load()
    return tree
