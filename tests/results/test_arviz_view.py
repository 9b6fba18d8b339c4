"""Every mode is a tree that ArviZ understands, and agrees with the numbers stored beside it."""

from __future__ import annotations

import arviz_stats
import numpy as np
import result_trees
import synthetic_rigs
import xarray as xr

from mofit.results import open_result, write_result


def test_summary_of_each_mode(tmp_path) -> None:
    file = write_result(result_trees.make_result(synthetic_rigs.damper(), steps=40), tmp_path)
    for mode in open_result(file)["modes"].children.values():
        table = arviz_stats.summary(mode, round_to="none")
        assert list(table.index) == list(mode["parameter"].values)
        for column, variable in (("mean", "mean"), ("sd", "sd"), ("ess_bulk", "ess"), ("r_hat", "r_hat")):
            np.testing.assert_allclose(table[column], mode[variable], rtol=1e-9)
    with xr.open_datatree(file, group="modes/m2") as alone:
        assert arviz_stats.summary(alone, round_to="none").equals(table)
