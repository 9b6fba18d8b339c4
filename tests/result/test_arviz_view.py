"""Every cluster is a tree that ArviZ understands, and agrees with the numbers stored beside it."""

from __future__ import annotations

import arviz_stats
import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr

from mofit.result import open_result, write_result


@pytest.mark.parametrize("rig", [synthetic_rigs.tyre, synthetic_rigs.crowded])
def test_summary_of_each_cluster(rig, tmp_path) -> None:
    file = write_result(result_trees.make_result(rig(), steps=40), tmp_path)
    for name, cluster in open_result(file)["clusters"].children.items():
        table = arviz_stats.summary(cluster, round_to="none")
        assert list(table.index) == list(cluster["parameter"].values)
        for column, variable in (("mean", "mean"), ("sd", "sd"), ("ess_bulk", "ess"), ("r_hat", "r_hat")):
            np.testing.assert_allclose(table[column], cluster[variable], rtol=1e-9)
        with xr.open_datatree(file, group=f"clusters/{name}") as alone:
            assert arviz_stats.summary(alone, round_to="none").equals(table)
