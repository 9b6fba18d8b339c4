"""Files written whole or not at all."""

import netCDF4
import numpy as np
import xarray as xr

from mofit.runtime.files import read_tree, write_tree


def test_writing_a_tree_keeps_little_of_the_file_in_memory_and_leaves_the_setting_as_it_was(tmp_path, monkeypatch):
    seen = []
    whole = xr.DataTree.to_netcdf

    def watched(*given, **options):
        seen.append(netCDF4.get_chunk_cache()[0])
        return whole(*given, **options)

    monkeypatch.setattr(xr.DataTree, "to_netcdf", watched)
    before = netCDF4.get_chunk_cache()
    write_tree(xr.DataTree(xr.Dataset({"y": ("t", np.arange(1000.0))})), tmp_path / "y.nc", level=1)
    assert seen == [1 << 20]
    assert netCDF4.get_chunk_cache() == before
    assert read_tree(tmp_path / "y.nc", "").dataset["y"].values[-1] == 999.0
